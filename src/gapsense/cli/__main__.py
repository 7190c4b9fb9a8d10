"""`python -m gapsense.cli`."""

from gapsense.__main__ import main

main()
