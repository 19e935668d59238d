"""`clearance view`: a browser page of a scene, its distances with their bounds, and a daemon's activity.

model.py combines the meshes of shapes.py with answers of an Engine or a Client; edge.py evaluates a motion, path.py a
path; shadow.py computes poses of links for other joint positions; tables.py and plots.py format text and numbers;
session.py connects them. These require only numpy. page.py, panel.py and viewer.py draw with viser (the wheel's extra
"view"), and command.py is the command.
"""
