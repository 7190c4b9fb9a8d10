"""Build and validate the FMU of every folder in fmus/, or of those named: `gapsense build` for this checkout.

python build_fmus.py [--out FOLDER] [--parameters FILE ...] [NAME ...]
"""

import sys

sys.path.append(sys.path.pop(0))  # other files beside this one stand in nobody's way

from pathlib import Path

from gapsense.cli import app

if __name__ == "__main__":
    app(["build", "--root", str(Path(__file__).resolve().parent), *sys.argv[1:]])
