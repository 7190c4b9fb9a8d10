"""Build and validate the FMU of every folder in fmus/, or of those named: `gapsense build` for this checkout.

python build_fmus.py [--out FOLDER] [--parameters FILE ...] [NAME ...]
"""

import sys

sys.path.append(sys.path.pop(0))  # other files beside this one stand in nobody's way

from gapsense.__main__ import main

if __name__ == "__main__":
    from pathlib import Path

    sys.argv[1:1] = ["build", "--root", str(Path(__file__).resolve().parent)]
    main()
