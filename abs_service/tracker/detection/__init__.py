"""The object in the first depth image: region, detection, initial mesh."""
