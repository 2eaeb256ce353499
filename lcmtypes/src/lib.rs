//! lcmtypes
