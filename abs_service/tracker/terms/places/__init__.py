"""Places in an image of the appearance of a mesh: of patches nearby, of keypoints anywhere."""
