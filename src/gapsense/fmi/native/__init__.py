"""Native FMUs: components in C, from the same port tables, kernels and sentences as the Python FMUs.

The C in the folder `c` is written by hand and the same for every component: `instance.h` is the component whatever the
version of FMI, `fmi2.c` a thin layer over it. What differs between components is data and arithmetic, and is generated:
`model.c` from the port table, `kernel.c` from the kernel.
"""

from pathlib import Path

SOURCES = Path(__file__).resolve().with_name("c")
