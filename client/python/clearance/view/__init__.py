"""`clearance view`: a browser page of a scene, its distances with their bounds, and what a daemon is doing.

shapes.py and model.py make a picture of what an Engine or a Client answers, edge.py one of a motion, tables.py the words
and numbers of both: nothing of these needs more than numpy. page.py and panel.py draw it by viser (`pip install
"clearance[view]"`), command.py is the command.
"""
