"""The live page: what a rig publishes, shown in a browser. `page.py`, `scene.py` and `panel.py` know viser."""
