"""The live page of a rig in a browser. `page.py`, `scene.py` and `panel.py` know viser."""
