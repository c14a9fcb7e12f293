"""The Fortran library: loading it, what crosses to it, and its sessions as Python objects."""
