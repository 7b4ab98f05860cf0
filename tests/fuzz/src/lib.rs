//! Fuzz targets for everything that reads what a stranger may have written.
