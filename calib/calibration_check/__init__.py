"""Check of a stored calibration against new views, with identification of the change.

Board poses are estimated anew, everything else is fixed. Four questions are answered: does each camera fit its own
corners; do these ask for another focal length or principal point; has a pair of sensors moved relative to each other
by more than the stored and new covariances allow; and which change (a sensor that moved, distances with another scale
or offset, a wrong alignment) predicts the shots best, and which others these shots cannot tell from it.
"""
