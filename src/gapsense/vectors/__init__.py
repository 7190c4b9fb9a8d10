"""A scenario of our own components over many runs at once: their kernels in C, in the order of its wires, without FMUs.

A run has the bits that it has through FMUs. What a kernel or its FMU would refuse is not done here: such a run is lost,
and whoever wants to know why does it again through FMUs.
"""
