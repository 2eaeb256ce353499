//! lcm-idl
