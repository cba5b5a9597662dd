//! The driver: pulls blocks through all stages into files.
