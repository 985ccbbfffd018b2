//! HDF5 files in the layout of BlenderProc.
