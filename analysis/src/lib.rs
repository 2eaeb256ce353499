//! polars probe
#[allow(unused_imports)] use polars as _;
