"""The live page of a rig in a browser. `page`, `panel`, `scene`, `player` and `acting` know viser."""
