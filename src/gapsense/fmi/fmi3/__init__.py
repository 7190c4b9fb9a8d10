"""What an FMU of FMI 3.0 says about itself; the library is that of the native FMUs."""
