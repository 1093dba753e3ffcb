"""Detection of the object in the first depth image: region, initial detection, initial mesh."""
