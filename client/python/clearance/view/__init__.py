"""`clearance view`: a browser page of a scene, its distances with their bounds, and what a daemon is doing.

model.py makes a picture of what an Engine or a Client answers, of the meshes of shapes.py; edge.py one of a motion;
shadow.py says where links would be; tables.py and plots.py have the words and numbers; session.py holds them together.
None of these needs more than numpy. page.py, panel.py and viewer.py draw them by viser (the wheel's extra
"view"), and command.py is the command.
"""
