"""Measures all cases in this process: frames and the scale of the generations as arguments, JSON as output."""

import json
import sys
from dataclasses import asdict

from evaluation.method.rates.cases import cases
from evaluation.method.rates.measuring import measure

if __name__ == "__main__":
    print(json.dumps({one.part: asdict(measure(one, int(sys.argv[1]))) for one in cases(float(sys.argv[2]))}))
