"""Runs of a scenario of our own components, many at once, without FMUs: kernels in C, in the order of the wires.

A run has the same bits as through FMUs. If a kernel or its FMU would refuse something, the run is given up here. Do it
again through FMUs to see why.
"""
