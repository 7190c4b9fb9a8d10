"""Writes a file as a library in C does that leaves the rest to the end of the process."""

import ctypes


def prepare(path):
    """Function that writes a text and neither flushes nor closes the file."""
    c = ctypes.CDLL(None)
    c.fopen.restype, c.fputs.argtypes = ctypes.c_void_p, (ctypes.c_char_p, ctypes.c_void_p)
    return lambda text: c.fputs(text.encode(), c.fopen(path.encode(), b"w"))
