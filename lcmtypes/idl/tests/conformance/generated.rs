// Generated from .lcm texts by lcm-idl, not to be edited.

/// Types of no package.
#[allow(missing_docs, reason = "the comment of a type says what its fields mean")]
#[allow(unused_variables, reason = "a type may have no field")]
#[allow(non_snake_case, non_upper_case_globals, clippy::all, rustdoc::all, reason = "names and texts are those of the .lcm")]
pub mod unnamed {
    use ::lcm_idl::wire as lcm_wire;

    /// Before any `package` line.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Bare {
        pub t: i64,
        pub more: ::std::vec::Vec<Bare>,
    }

    impl ::std::default::Default for Bare {
        fn default() -> Self {
            Self {
                t: 0,
                more: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for Bare {
        const TYPE: &'static str = "bare_t";
        const FINGERPRINT: u64 = 0x256b55c6748dc445;
    }

    impl lcm_wire::Wire for Bare {
        const MIN_SIZE: usize = 8;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.t.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "more", self.more.len(), "t", self.t)?;
            for item_0 in self.more.iter() {
                item_0.put(out)?;
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_t = wire.field("t", lcm_wire::Wire::take)?;
            let field_more = wire.field("more", |wire| wire.list("t", field_t, 8, |wire| wire.nested(lcm_wire::Wire::take)))?;
            Ok(Self { t: field_t, more: field_more })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.t = wire.field("t", lcm_wire::Wire::take)?;
            wire.field("more", |wire| wire.retake_list(&mut self.more, "t", self.t, 8))?;
            Ok(())
        }
    }
}

/// Types of package `conformance`.
#[allow(missing_docs, reason = "the comment of a type says what its fields mean")]
#[allow(unused_variables, reason = "a type may have no field")]
#[allow(non_snake_case, non_upper_case_globals, clippy::all, rustdoc::all, reason = "names and texts are those of the .lcm")]
pub mod conformance {
    use ::lcm_idl::wire as lcm_wire;

    /// Numbers in the order of the text: 1, 5, 6, -3, 7.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub struct Colour(pub i32);

    impl Colour {
        pub const RED: Self = Self(1);
        pub const GREEN: Self = Self(5);
        pub const BLUE: Self = Self(6);
        pub const INFRARED: Self = Self(-3);
        pub const VIOLET: Self = Self(7);
    }

    impl lcm_wire::Wire for Colour {
        const MIN_SIZE: usize = 4;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.0.put(out)
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            lcm_wire::Wire::take(wire).map(Self)
        }
    }

    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub struct Other(pub i32);

    impl Other {
        pub const A: Self = Self(16);
        pub const B: Self = Self(17);
    }

    impl lcm_wire::Wire for Other {
        const MIN_SIZE: usize = 4;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.0.put(out)
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            lcm_wire::Wire::take(wire).map(Self)
        }
    }

    /// Dimensions: fixed, hexadecimal, variable, and mixtures of them.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Arrays {
        pub n8: i8,
        pub n16: i16,
        pub n32: i32,
        pub n64: i64,
        pub fixed: [f64; 3],
        pub matrix: [[f32; 3]; 2],
        pub by_n8: ::std::vec::Vec<i16>,
        pub by_n16: ::std::vec::Vec<bool>,
        pub by_n32: ::std::vec::Vec<::std::string::String>,
        pub by_n64: ::std::vec::Vec<u8>,
        pub rows: ::std::vec::Vec<[f64; 3]>,
        pub columns: [::std::vec::Vec<f64>; 2],
        pub square: ::std::vec::Vec<::std::vec::Vec<i32>>,
        pub cube: ::std::vec::Vec<[::std::vec::Vec<i8>; 2]>,
        pub hexadecimal: [::std::vec::Vec<i64>; 3],
        pub names: [::std::string::String; 2],
        pub raw: [u8; 4],
    }

    impl ::std::default::Default for Arrays {
        fn default() -> Self {
            Self {
                n8: 0,
                n16: 0,
                n32: 0,
                n64: 0,
                fixed: ::std::array::from_fn(|_| 0.0),
                matrix: ::std::array::from_fn(|_| ::std::array::from_fn(|_| 0.0)),
                by_n8: ::std::vec::Vec::new(),
                by_n16: ::std::vec::Vec::new(),
                by_n32: ::std::vec::Vec::new(),
                by_n64: ::std::vec::Vec::new(),
                rows: ::std::vec::Vec::new(),
                columns: ::std::array::from_fn(|_| ::std::vec::Vec::new()),
                square: ::std::vec::Vec::new(),
                cube: ::std::vec::Vec::new(),
                hexadecimal: ::std::array::from_fn(|_| ::std::vec::Vec::new()),
                names: ::std::array::from_fn(|_| ::std::string::String::new()),
                raw: ::std::array::from_fn(|_| 0),
            }
        }
    }

    impl lcm_wire::Message for Arrays {
        const TYPE: &'static str = "conformance.arrays_t";
        const FINGERPRINT: u64 = 0xf9c6e9cf33ac8305;
    }

    impl lcm_wire::Wire for Arrays {
        const MIN_SIZE: usize = 77;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.n8.put(out)?;
            self.n16.put(out)?;
            self.n32.put(out)?;
            self.n64.put(out)?;
            self.fixed.put(out)?;
            self.matrix.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "by_n8", self.by_n8.len(), "n8", i64::from(self.n8))?;
            for item_0 in self.by_n8.iter() {
                item_0.put(out)?;
            }
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "by_n16", self.by_n16.len(), "n16", i64::from(self.n16))?;
            for item_0 in self.by_n16.iter() {
                item_0.put(out)?;
            }
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "by_n32", self.by_n32.len(), "n32", i64::from(self.n32))?;
            for item_0 in self.by_n32.iter() {
                item_0.put(out)?;
            }
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "by_n64", self.by_n64.len(), "n64", self.n64)?;
            out.extend_from_slice(&self.by_n64);
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "rows", self.rows.len(), "n32", i64::from(self.n32))?;
            for item_0 in self.rows.iter() {
                item_0.put(out)?;
            }
            for item_0 in self.columns.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "columns", item_0.len(), "n8", i64::from(self.n8))?;
                for item_1 in item_0.iter() {
                    item_1.put(out)?;
                }
            }
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "square", self.square.len(), "n8", i64::from(self.n8))?;
            for item_0 in self.square.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "square", item_0.len(), "n16", i64::from(self.n16))?;
                for item_1 in item_0.iter() {
                    item_1.put(out)?;
                }
            }
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "cube", self.cube.len(), "n8", i64::from(self.n8))?;
            for item_0 in self.cube.iter() {
                for item_1 in item_0.iter() {
                    lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "cube", item_1.len(), "n32", i64::from(self.n32))?;
                    for item_2 in item_1.iter() {
                        item_2.put(out)?;
                    }
                }
            }
            for item_0 in self.hexadecimal.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "hexadecimal", item_0.len(), "n8", i64::from(self.n8))?;
                for item_1 in item_0.iter() {
                    item_1.put(out)?;
                }
            }
            self.names.put(out)?;
            self.raw.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_n8 = wire.field("n8", lcm_wire::Wire::take)?;
            let field_n16 = wire.field("n16", lcm_wire::Wire::take)?;
            let field_n32 = wire.field("n32", lcm_wire::Wire::take)?;
            let field_n64 = wire.field("n64", lcm_wire::Wire::take)?;
            let field_fixed = wire.field("fixed", lcm_wire::Wire::take)?;
            let field_matrix = wire.field("matrix", lcm_wire::Wire::take)?;
            let field_by_n8 = wire.field("by_n8", |wire| wire.list("n8", i64::from(field_n8), 2, lcm_wire::Wire::take))?;
            let field_by_n16 = wire.field("by_n16", |wire| wire.list("n16", i64::from(field_n16), 1, lcm_wire::Wire::take))?;
            let field_by_n32 = wire.field("by_n32", |wire| wire.list("n32", i64::from(field_n32), 5, lcm_wire::Wire::take))?;
            let field_by_n64 = wire.field("by_n64", |wire| wire.byte_list("n64", field_n64).map(<[u8]>::to_vec))?;
            let field_rows = wire.field("rows", |wire| wire.list("n32", i64::from(field_n32), lcm_wire::row_size(&[3], 8), lcm_wire::Wire::take))?;
            let field_columns = wire.field("columns", |wire| wire.array(|wire| wire.list("n8", i64::from(field_n8), 8, lcm_wire::Wire::take)))?;
            let field_square = wire.field("square", |wire| wire.list("n8", i64::from(field_n8), lcm_wire::row_size(&[i64::from(field_n16)], 4), |wire| wire.list("n16", i64::from(field_n16), 4, lcm_wire::Wire::take)))?;
            let field_cube = wire.field("cube", |wire| wire.list("n8", i64::from(field_n8), lcm_wire::row_size(&[2, i64::from(field_n32)], 1), |wire| wire.array(|wire| wire.list("n32", i64::from(field_n32), 1, lcm_wire::Wire::take))))?;
            let field_hexadecimal = wire.field("hexadecimal", |wire| wire.array(|wire| wire.list("n8", i64::from(field_n8), 8, lcm_wire::Wire::take)))?;
            let field_names = wire.field("names", lcm_wire::Wire::take)?;
            let field_raw = wire.field("raw", lcm_wire::Wire::take)?;
            Ok(Self { n8: field_n8, n16: field_n16, n32: field_n32, n64: field_n64, fixed: field_fixed, matrix: field_matrix, by_n8: field_by_n8, by_n16: field_by_n16, by_n32: field_by_n32, by_n64: field_by_n64, rows: field_rows, columns: field_columns, square: field_square, cube: field_cube, hexadecimal: field_hexadecimal, names: field_names, raw: field_raw })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.n8 = wire.field("n8", lcm_wire::Wire::take)?;
            self.n16 = wire.field("n16", lcm_wire::Wire::take)?;
            self.n32 = wire.field("n32", lcm_wire::Wire::take)?;
            self.n64 = wire.field("n64", lcm_wire::Wire::take)?;
            self.fixed = wire.field("fixed", lcm_wire::Wire::take)?;
            self.matrix = wire.field("matrix", lcm_wire::Wire::take)?;
            wire.field("by_n8", |wire| wire.refill(&mut self.by_n8, "n8", i64::from(self.n8), 2, lcm_wire::Wire::take))?;
            wire.field("by_n16", |wire| wire.refill(&mut self.by_n16, "n16", i64::from(self.n16), 1, lcm_wire::Wire::take))?;
            wire.field("by_n32", |wire| wire.retake_list(&mut self.by_n32, "n32", i64::from(self.n32), 5))?;
            let bytes = wire.field("by_n64", |wire| wire.byte_list("n64", self.n64))?;
            self.by_n64.clear();
            self.by_n64.extend_from_slice(bytes);
            wire.field("rows", |wire| wire.refill(&mut self.rows, "n32", i64::from(self.n32), lcm_wire::row_size(&[3], 8), lcm_wire::Wire::take))?;
            self.columns = wire.field("columns", |wire| wire.array(|wire| wire.list("n8", i64::from(self.n8), 8, lcm_wire::Wire::take)))?;
            wire.field("square", |wire| wire.refill(&mut self.square, "n8", i64::from(self.n8), lcm_wire::row_size(&[i64::from(self.n16)], 4), |wire| wire.list("n16", i64::from(self.n16), 4, lcm_wire::Wire::take)))?;
            wire.field("cube", |wire| wire.refill(&mut self.cube, "n8", i64::from(self.n8), lcm_wire::row_size(&[2, i64::from(self.n32)], 1), |wire| wire.array(|wire| wire.list("n32", i64::from(self.n32), 1, lcm_wire::Wire::take))))?;
            self.hexadecimal = wire.field("hexadecimal", |wire| wire.array(|wire| wire.list("n8", i64::from(self.n8), 8, lcm_wire::Wire::take)))?;
            self.names = wire.field("names", lcm_wire::Wire::take)?;
            self.raw = wire.field("raw", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// Only a fingerprint of it is stored: the stock Python code cannot encode a hexadecimal innermost size.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Hexadecimal {
        pub x: [f32; 16],
        pub y: [[u8; 10]; 2],
    }

    impl ::std::default::Default for Hexadecimal {
        fn default() -> Self {
            Self {
                x: ::std::array::from_fn(|_| 0.0),
                y: ::std::array::from_fn(|_| ::std::array::from_fn(|_| 0)),
            }
        }
    }

    impl lcm_wire::Message for Hexadecimal {
        const TYPE: &'static str = "conformance.hexadecimal_t";
        const FINGERPRINT: u64 = 0x28000cf039c68519;
    }

    impl lcm_wire::Wire for Hexadecimal {
        const MIN_SIZE: usize = 84;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.x.put(out)?;
            self.y.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_x = wire.field("x", lcm_wire::Wire::take)?;
            let field_y = wire.field("y", lcm_wire::Wire::take)?;
            Ok(Self { x: field_x, y: field_y })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.x = wire.field("x", lcm_wire::Wire::take)?;
            self.y = wire.field("y", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// Several fields in one declaration, each with dimensions of its own.
    #[derive(Clone, Debug, PartialEq)]
    pub struct OneLine {
        pub a: i32,
        pub b: [i32; 2],
        pub c: ::std::vec::Vec<i32>,
        pub d: ::std::string::String,
        pub e: ::std::string::String,
    }

    impl ::std::default::Default for OneLine {
        fn default() -> Self {
            Self {
                a: 0,
                b: ::std::array::from_fn(|_| 0),
                c: ::std::vec::Vec::new(),
                d: ::std::string::String::new(),
                e: ::std::string::String::new(),
            }
        }
    }

    impl lcm_wire::Message for OneLine {
        const TYPE: &'static str = "conformance.one_line_t";
        const FINGERPRINT: u64 = 0x798da781b1dcd497;
    }

    impl lcm_wire::Wire for OneLine {
        const MIN_SIZE: usize = 22;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.a.put(out)?;
            self.b.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "c", self.c.len(), "a", i64::from(self.a))?;
            for item_0 in self.c.iter() {
                item_0.put(out)?;
            }
            self.d.put(out)?;
            self.e.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_a = wire.field("a", lcm_wire::Wire::take)?;
            let field_b = wire.field("b", lcm_wire::Wire::take)?;
            let field_c = wire.field("c", |wire| wire.list("a", i64::from(field_a), 4, lcm_wire::Wire::take))?;
            let field_d = wire.field("d", lcm_wire::Wire::take)?;
            let field_e = wire.field("e", lcm_wire::Wire::take)?;
            Ok(Self { a: field_a, b: field_b, c: field_c, d: field_d, e: field_e })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.a = wire.field("a", lcm_wire::Wire::take)?;
            self.b = wire.field("b", lcm_wire::Wire::take)?;
            wire.field("c", |wire| wire.refill(&mut self.c, "a", i64::from(self.a), 4, lcm_wire::Wire::take))?;
            wire.field("d", |wire| lcm_wire::Wire::retake(&mut self.d, wire))?;
            wire.field("e", |wire| lcm_wire::Wire::retake(&mut self.e, wire))?;
            Ok(())
        }
    }

    /// More elements than the standard library has a `Default` for.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Long {
        pub x: [i16; 40],
        pub y: [[f64; 34]; 33],
    }

    impl ::std::default::Default for Long {
        fn default() -> Self {
            Self {
                x: ::std::array::from_fn(|_| 0),
                y: ::std::array::from_fn(|_| ::std::array::from_fn(|_| 0.0)),
            }
        }
    }

    impl lcm_wire::Message for Long {
        const TYPE: &'static str = "conformance.long_t";
        const FINGERPRINT: u64 = 0x3bf8c088a34db081;
    }

    impl lcm_wire::Wire for Long {
        const MIN_SIZE: usize = 9056;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.x.put(out)?;
            self.y.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_x = wire.field("x", lcm_wire::Wire::take)?;
            let field_y = wire.field("y", lcm_wire::Wire::take)?;
            Ok(Self { x: field_x, y: field_y })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.x = wire.field("x", lcm_wire::Wire::take)?;
            self.y = wire.field("y", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// First line,
    ///   second line, indented.
    ///
    /// Fourth line with "quotes", `ticks`, \backslashes\ and [brackets].
    #[derive(Clone, Debug, PartialEq)]
    pub struct Commented {
        /// A block above a field.
        pub num_x: i32,
        /// above a field
        pub x: ::std::vec::Vec<f64>,
        /// keywords of Rust
        pub r#type: i8,
        /// keywords of Rust
        pub r#match: i8,
        /// keywords of Rust
        pub self_: i8,
        /// keywords of Rust
        pub r#box: i8,
    }

    impl Commented {
        pub const K: i32 = 1;
        pub const L: i32 = 2;
    }

    impl ::std::default::Default for Commented {
        fn default() -> Self {
            Self {
                num_x: 0,
                x: ::std::vec::Vec::new(),
                r#type: 0,
                r#match: 0,
                self_: 0,
                r#box: 0,
            }
        }
    }

    impl lcm_wire::Message for Commented {
        const TYPE: &'static str = "conformance.commented_t";
        const FINGERPRINT: u64 = 0x4808978c67567581;
    }

    impl lcm_wire::Wire for Commented {
        const MIN_SIZE: usize = 8;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.num_x.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "x", self.x.len(), "num_x", i64::from(self.num_x))?;
            for item_0 in self.x.iter() {
                item_0.put(out)?;
            }
            self.r#type.put(out)?;
            self.r#match.put(out)?;
            self.self_.put(out)?;
            self.r#box.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_num_x = wire.field("num_x", lcm_wire::Wire::take)?;
            let field_x = wire.field("x", |wire| wire.list("num_x", i64::from(field_num_x), 8, lcm_wire::Wire::take))?;
            let field_type = wire.field("type", lcm_wire::Wire::take)?;
            let field_match = wire.field("match", lcm_wire::Wire::take)?;
            let field_self = wire.field("self", lcm_wire::Wire::take)?;
            let field_box = wire.field("box", lcm_wire::Wire::take)?;
            Ok(Self { num_x: field_num_x, x: field_x, r#type: field_type, r#match: field_match, self_: field_self, r#box: field_box })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.num_x = wire.field("num_x", lcm_wire::Wire::take)?;
            wire.field("x", |wire| wire.refill(&mut self.x, "num_x", i64::from(self.num_x), 8, lcm_wire::Wire::take))?;
            self.r#type = wire.field("type", lcm_wire::Wire::take)?;
            self.r#match = wire.field("match", lcm_wire::Wire::take)?;
            self.self_ = wire.field("self", lcm_wire::Wire::take)?;
            self.r#box = wire.field("box", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct NoComment {
        pub const_: i8,
    }

    impl ::std::default::Default for NoComment {
        fn default() -> Self {
            Self {
                const_: 0,
            }
        }
    }

    impl lcm_wire::Message for NoComment {
        const TYPE: &'static str = "conformance.no_comment_t";
        const FINGERPRINT: u64 = 0xecec6aa62ae28dd1;
    }

    impl lcm_wire::Wire for NoComment {
        const MIN_SIZE: usize = 1;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.const_.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_const_ = wire.field("const_", lcm_wire::Wire::take)?;
            Ok(Self { const_: field_const_ })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.const_ = wire.field("const_", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// Each other: the fingerprint depends on where one begins.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Ping {
        pub n: i8,
        pub pongs: ::std::vec::Vec<Pong>,
        pub r#where: Point,
    }

    impl ::std::default::Default for Ping {
        fn default() -> Self {
            Self {
                n: 0,
                pongs: ::std::vec::Vec::new(),
                r#where: ::std::default::Default::default(),
            }
        }
    }

    impl lcm_wire::Message for Ping {
        const TYPE: &'static str = "conformance.ping_t";
        const FINGERPRINT: u64 = 0xf01a1061c55de3f1;
    }

    impl lcm_wire::Wire for Ping {
        const MIN_SIZE: usize = 17;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.n.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "pongs", self.pongs.len(), "n", i64::from(self.n))?;
            for item_0 in self.pongs.iter() {
                item_0.put(out)?;
            }
            self.r#where.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_n = wire.field("n", lcm_wire::Wire::take)?;
            let field_pongs = wire.field("pongs", |wire| wire.list("n", i64::from(field_n), 8, |wire| wire.nested(lcm_wire::Wire::take)))?;
            let field_where = wire.field("where", |wire| wire.nested(lcm_wire::Wire::take))?;
            Ok(Self { n: field_n, pongs: field_pongs, r#where: field_where })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.n = wire.field("n", lcm_wire::Wire::take)?;
            wire.field("pongs", |wire| wire.retake_list(&mut self.pongs, "n", i64::from(self.n), 8))?;
            wire.field("where", |wire| wire.nested(|wire| lcm_wire::Wire::retake(&mut self.r#where, wire)))?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct Pong {
        pub n: i8,
        pub pings: ::std::vec::Vec<Ping>,
        pub node: Node,
    }

    impl ::std::default::Default for Pong {
        fn default() -> Self {
            Self {
                n: 0,
                pings: ::std::vec::Vec::new(),
                node: ::std::default::Default::default(),
            }
        }
    }

    impl lcm_wire::Message for Pong {
        const TYPE: &'static str = "conformance.pong_t";
        const FINGERPRINT: u64 = 0x0790c4b932a81f47;
    }

    impl lcm_wire::Wire for Pong {
        const MIN_SIZE: usize = 8;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.n.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "pings", self.pings.len(), "n", i64::from(self.n))?;
            for item_0 in self.pings.iter() {
                item_0.put(out)?;
            }
            self.node.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_n = wire.field("n", lcm_wire::Wire::take)?;
            let field_pings = wire.field("pings", |wire| wire.list("n", i64::from(field_n), 17, |wire| wire.nested(lcm_wire::Wire::take)))?;
            let field_node = wire.field("node", |wire| wire.nested(lcm_wire::Wire::take))?;
            Ok(Self { n: field_n, pings: field_pings, node: field_node })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.n = wire.field("n", lcm_wire::Wire::take)?;
            wire.field("pings", |wire| wire.retake_list(&mut self.pings, "n", i64::from(self.n), 17))?;
            wire.field("node", |wire| wire.nested(|wire| lcm_wire::Wire::retake(&mut self.node, wire)))?;
            Ok(())
        }
    }

    /// Constants as dimensions: since lcm-gen 1.5. The fingerprint covers their values as written.
    #[derive(Clone, Debug, PartialEq)]
    pub struct NamedConstants {
        pub matrix: [[f64; 3]; 2],
        pub n: i32,
        pub mixed: [::std::vec::Vec<i32>; 2],
    }

    impl NamedConstants {
        pub const ROWS: i32 = 2;
        pub const COLUMNS: i32 = 3;
        pub const HEXADECIMAL: i8 = 2;
    }

    impl ::std::default::Default for NamedConstants {
        fn default() -> Self {
            Self {
                matrix: ::std::array::from_fn(|_| ::std::array::from_fn(|_| 0.0)),
                n: 0,
                mixed: ::std::array::from_fn(|_| ::std::vec::Vec::new()),
            }
        }
    }

    impl lcm_wire::Message for NamedConstants {
        const TYPE: &'static str = "conformance.named_constants_t";
        const FINGERPRINT: u64 = 0x0a7cbe823ed92e0a;
    }

    impl lcm_wire::Wire for NamedConstants {
        const MIN_SIZE: usize = 52;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.matrix.put(out)?;
            self.n.put(out)?;
            for item_0 in self.mixed.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "mixed", item_0.len(), "n", i64::from(self.n))?;
                for item_1 in item_0.iter() {
                    item_1.put(out)?;
                }
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_matrix = wire.field("matrix", lcm_wire::Wire::take)?;
            let field_n = wire.field("n", lcm_wire::Wire::take)?;
            let field_mixed = wire.field("mixed", |wire| wire.array(|wire| wire.list("n", i64::from(field_n), 4, lcm_wire::Wire::take)))?;
            Ok(Self { matrix: field_matrix, n: field_n, mixed: field_mixed })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.matrix = wire.field("matrix", lcm_wire::Wire::take)?;
            self.n = wire.field("n", lcm_wire::Wire::take)?;
            self.mixed = wire.field("mixed", |wire| wire.array(|wire| wire.list("n", i64::from(self.n), 4, lcm_wire::Wire::take)))?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct Nested {
        pub n: i32,
        pub p: Point,
        pub q: [Point; 2],
        pub r: ::std::vec::Vec<super::elsewhere_deep::Point>,
        pub nothing: [Empty; 3],
        pub colour: Colour,
    }

    impl ::std::default::Default for Nested {
        fn default() -> Self {
            Self {
                n: 0,
                p: ::std::default::Default::default(),
                q: ::std::array::from_fn(|_| ::std::default::Default::default()),
                r: ::std::vec::Vec::new(),
                nothing: ::std::array::from_fn(|_| ::std::default::Default::default()),
                colour: ::std::default::Default::default(),
            }
        }
    }

    impl lcm_wire::Message for Nested {
        const TYPE: &'static str = "conformance.nested_t";
        const FINGERPRINT: u64 = 0xcc65eefdcd51348c;
    }

    impl lcm_wire::Wire for Nested {
        const MIN_SIZE: usize = 56;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.n.put(out)?;
            self.p.put(out)?;
            self.q.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "r", self.r.len(), "n", i64::from(self.n))?;
            for item_0 in self.r.iter() {
                item_0.put(out)?;
            }
            self.nothing.put(out)?;
            self.colour.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_n = wire.field("n", lcm_wire::Wire::take)?;
            let field_p = wire.field("p", |wire| wire.nested(lcm_wire::Wire::take))?;
            let field_q = wire.field("q", |wire| wire.array(|wire| wire.nested(lcm_wire::Wire::take)))?;
            let field_r = wire.field("r", |wire| wire.list("n", i64::from(field_n), 24, |wire| wire.nested(lcm_wire::Wire::take)))?;
            let field_nothing = wire.field("nothing", |wire| wire.array(|wire| wire.nested(lcm_wire::Wire::take)))?;
            let field_colour = wire.field("colour", lcm_wire::Wire::take)?;
            Ok(Self { n: field_n, p: field_p, q: field_q, r: field_r, nothing: field_nothing, colour: field_colour })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.n = wire.field("n", lcm_wire::Wire::take)?;
            wire.field("p", |wire| wire.nested(|wire| lcm_wire::Wire::retake(&mut self.p, wire)))?;
            self.q = wire.field("q", |wire| wire.array(|wire| wire.nested(lcm_wire::Wire::take)))?;
            wire.field("r", |wire| wire.retake_list(&mut self.r, "n", i64::from(self.n), 24))?;
            self.nothing = wire.field("nothing", |wire| wire.array(|wire| wire.nested(lcm_wire::Wire::take)))?;
            self.colour = wire.field("colour", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// Apart from the rest: the stock C code of 1.3.1 cannot decode arrays of enums.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Enums {
        pub n: i32,
        pub palette: ::std::vec::Vec<Colour>,
        pub other: [Other; 2],
    }

    impl ::std::default::Default for Enums {
        fn default() -> Self {
            Self {
                n: 0,
                palette: ::std::vec::Vec::new(),
                other: ::std::array::from_fn(|_| ::std::default::Default::default()),
            }
        }
    }

    impl lcm_wire::Message for Enums {
        const TYPE: &'static str = "conformance.enums_t";
        const FINGERPRINT: u64 = 0x9a96224139a1ee5f;
    }

    impl lcm_wire::Wire for Enums {
        const MIN_SIZE: usize = 12;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.n.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "palette", self.palette.len(), "n", i64::from(self.n))?;
            for item_0 in self.palette.iter() {
                item_0.put(out)?;
            }
            self.other.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_n = wire.field("n", lcm_wire::Wire::take)?;
            let field_palette = wire.field("palette", |wire| wire.list("n", i64::from(field_n), 4, lcm_wire::Wire::take))?;
            let field_other = wire.field("other", lcm_wire::Wire::take)?;
            Ok(Self { n: field_n, palette: field_palette, other: field_other })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.n = wire.field("n", lcm_wire::Wire::take)?;
            wire.field("palette", |wire| wire.refill(&mut self.palette, "n", i64::from(self.n), 4, lcm_wire::Wire::take))?;
            self.other = wire.field("other", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct Point {
        pub x: f64,
        pub y: f64,
    }

    impl ::std::default::Default for Point {
        fn default() -> Self {
            Self {
                x: 0.0,
                y: 0.0,
            }
        }
    }

    impl lcm_wire::Message for Point {
        const TYPE: &'static str = "conformance.point_t";
        const FINGERPRINT: u64 = 0xa4b2a25c6168910b;
    }

    impl lcm_wire::Wire for Point {
        const MIN_SIZE: usize = 16;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.x.put(out)?;
            self.y.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_x = wire.field("x", lcm_wire::Wire::take)?;
            let field_y = wire.field("y", lcm_wire::Wire::take)?;
            Ok(Self { x: field_x, y: field_y })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.x = wire.field("x", lcm_wire::Wire::take)?;
            self.y = wire.field("y", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// Itself, in an array of variable length.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Node {
        pub name: ::std::string::String,
        pub num_children: i16,
        pub children: ::std::vec::Vec<Node>,
    }

    impl ::std::default::Default for Node {
        fn default() -> Self {
            Self {
                name: ::std::string::String::new(),
                num_children: 0,
                children: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for Node {
        const TYPE: &'static str = "conformance.node_t";
        const FINGERPRINT: u64 = 0x472652fc836624a8;
    }

    impl lcm_wire::Wire for Node {
        const MIN_SIZE: usize = 7;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.name.put(out)?;
            self.num_children.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "children", self.children.len(), "num_children", i64::from(self.num_children))?;
            for item_0 in self.children.iter() {
                item_0.put(out)?;
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_name = wire.field("name", lcm_wire::Wire::take)?;
            let field_num_children = wire.field("num_children", lcm_wire::Wire::take)?;
            let field_children = wire.field("children", |wire| wire.list("num_children", i64::from(field_num_children), 7, |wire| wire.nested(lcm_wire::Wire::take)))?;
            Ok(Self { name: field_name, num_children: field_num_children, children: field_children })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            wire.field("name", |wire| lcm_wire::Wire::retake(&mut self.name, wire))?;
            self.num_children = wire.field("num_children", lcm_wire::Wire::take)?;
            wire.field("children", |wire| wire.retake_list(&mut self.children, "num_children", i64::from(self.num_children), 7))?;
            Ok(())
        }
    }

    /// Every primitive type,
    /// and every type of constant.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Primitives {
        pub i8: i8,
        pub i16: i16,
        pub i32: i32,
        pub i64: i64,
        pub b: u8,
        pub f: f32,
        pub d: f64,
        pub s: ::std::string::String,
        pub yes: bool,
    }

    impl Primitives {
        pub const SMALLEST: i8 = -128;
        pub const LARGEST: i8 = 127;
        pub const HEXADECIMAL: i8 = 127;
        pub const PORT: i16 = 7667;
        pub const SIGN: i32 = -2147483648;
        pub const BIG: i64 = 9223372036854775807;
        pub const THIRD: f32 = 0.33333334;
        pub const AVOGADRO: f32 = 6.0221406e23;
        pub const PI: f64 = 3.141592653589793;
        pub const TINY: f64 = -1e-300;
        pub const HALF: f64 = 0.5;
        pub const INTEGER: f64 = 3.0;
    }

    impl ::std::default::Default for Primitives {
        fn default() -> Self {
            Self {
                i8: 0,
                i16: 0,
                i32: 0,
                i64: 0,
                b: 0,
                f: 0.0,
                d: 0.0,
                s: ::std::string::String::new(),
                yes: false,
            }
        }
    }

    impl lcm_wire::Message for Primitives {
        const TYPE: &'static str = "conformance.primitives_t";
        const FINGERPRINT: u64 = 0xce47a949b808cbfa;
    }

    impl lcm_wire::Wire for Primitives {
        const MIN_SIZE: usize = 34;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.i8.put(out)?;
            self.i16.put(out)?;
            self.i32.put(out)?;
            self.i64.put(out)?;
            self.b.put(out)?;
            self.f.put(out)?;
            self.d.put(out)?;
            self.s.put(out)?;
            self.yes.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_i8 = wire.field("i8", lcm_wire::Wire::take)?;
            let field_i16 = wire.field("i16", lcm_wire::Wire::take)?;
            let field_i32 = wire.field("i32", lcm_wire::Wire::take)?;
            let field_i64 = wire.field("i64", lcm_wire::Wire::take)?;
            let field_b = wire.field("b", lcm_wire::Wire::take)?;
            let field_f = wire.field("f", lcm_wire::Wire::take)?;
            let field_d = wire.field("d", lcm_wire::Wire::take)?;
            let field_s = wire.field("s", lcm_wire::Wire::take)?;
            let field_yes = wire.field("yes", lcm_wire::Wire::take)?;
            Ok(Self { i8: field_i8, i16: field_i16, i32: field_i32, i64: field_i64, b: field_b, f: field_f, d: field_d, s: field_s, yes: field_yes })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.i8 = wire.field("i8", lcm_wire::Wire::take)?;
            self.i16 = wire.field("i16", lcm_wire::Wire::take)?;
            self.i32 = wire.field("i32", lcm_wire::Wire::take)?;
            self.i64 = wire.field("i64", lcm_wire::Wire::take)?;
            self.b = wire.field("b", lcm_wire::Wire::take)?;
            self.f = wire.field("f", lcm_wire::Wire::take)?;
            self.d = wire.field("d", lcm_wire::Wire::take)?;
            wire.field("s", |wire| lcm_wire::Wire::retake(&mut self.s, wire))?;
            self.yes = wire.field("yes", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    /// No field at all: eight bytes of fingerprint.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Empty {
    }

    impl ::std::default::Default for Empty {
        fn default() -> Self {
            Self {
            }
        }
    }

    impl lcm_wire::Message for Empty {
        const TYPE: &'static str = "conformance.empty_t";
        const FINGERPRINT: u64 = 0x000000002468acf0;
    }

    impl lcm_wire::Wire for Empty {
        const MIN_SIZE: usize = 0;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            Ok(Self {  })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            Ok(())
        }
    }
}

/// Types of package `elsewhere.deep`.
#[allow(missing_docs, reason = "the comment of a type says what its fields mean")]
#[allow(unused_variables, reason = "a type may have no field")]
#[allow(non_snake_case, non_upper_case_globals, clippy::all, rustdoc::all, reason = "names and texts are those of the .lcm")]
pub mod elsewhere_deep {
    use ::lcm_idl::wire as lcm_wire;

    /// Another package in the same file.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Point {
        pub x: f32,
        pub y: f32,
        pub exact: super::conformance::Point,
    }

    impl ::std::default::Default for Point {
        fn default() -> Self {
            Self {
                x: 0.0,
                y: 0.0,
                exact: ::std::default::Default::default(),
            }
        }
    }

    impl lcm_wire::Message for Point {
        const TYPE: &'static str = "elsewhere.deep.point_t";
        const FINGERPRINT: u64 = 0x8169c3c89ae4affb;
    }

    impl lcm_wire::Wire for Point {
        const MIN_SIZE: usize = 24;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.x.put(out)?;
            self.y.put(out)?;
            self.exact.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_x = wire.field("x", lcm_wire::Wire::take)?;
            let field_y = wire.field("y", lcm_wire::Wire::take)?;
            let field_exact = wire.field("exact", |wire| wire.nested(lcm_wire::Wire::take))?;
            Ok(Self { x: field_x, y: field_y, exact: field_exact })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.x = wire.field("x", lcm_wire::Wire::take)?;
            self.y = wire.field("y", lcm_wire::Wire::take)?;
            wire.field("exact", |wire| wire.nested(|wire| lcm_wire::Wire::retake(&mut self.exact, wire)))?;
            Ok(())
        }
    }
}

/// Types of package `exlcm`.
#[allow(missing_docs, reason = "the comment of a type says what its fields mean")]
#[allow(unused_variables, reason = "a type may have no field")]
#[allow(non_snake_case, non_upper_case_globals, clippy::all, rustdoc::all, reason = "names and texts are those of the .lcm")]
pub mod exlcm {
    use ::lcm_idl::wire as lcm_wire;

    #[derive(Clone, Debug, PartialEq)]
    pub struct Example {
        pub timestamp: i64,
        pub position: [f64; 3],
        pub orientation: [f64; 4],
        pub num_ranges: i32,
        pub ranges: ::std::vec::Vec<i16>,
        pub name: ::std::string::String,
        pub enabled: bool,
    }

    impl ::std::default::Default for Example {
        fn default() -> Self {
            Self {
                timestamp: 0,
                position: ::std::array::from_fn(|_| 0.0),
                orientation: ::std::array::from_fn(|_| 0.0),
                num_ranges: 0,
                ranges: ::std::vec::Vec::new(),
                name: ::std::string::String::new(),
                enabled: false,
            }
        }
    }

    impl lcm_wire::Message for Example {
        const TYPE: &'static str = "exlcm.example_t";
        const FINGERPRINT: u64 = 0x37553c5361f75516;
    }

    impl lcm_wire::Wire for Example {
        const MIN_SIZE: usize = 74;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.timestamp.put(out)?;
            self.position.put(out)?;
            self.orientation.put(out)?;
            self.num_ranges.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "ranges", self.ranges.len(), "num_ranges", i64::from(self.num_ranges))?;
            for item_0 in self.ranges.iter() {
                item_0.put(out)?;
            }
            self.name.put(out)?;
            self.enabled.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_timestamp = wire.field("timestamp", lcm_wire::Wire::take)?;
            let field_position = wire.field("position", lcm_wire::Wire::take)?;
            let field_orientation = wire.field("orientation", lcm_wire::Wire::take)?;
            let field_num_ranges = wire.field("num_ranges", lcm_wire::Wire::take)?;
            let field_ranges = wire.field("ranges", |wire| wire.list("num_ranges", i64::from(field_num_ranges), 2, lcm_wire::Wire::take))?;
            let field_name = wire.field("name", lcm_wire::Wire::take)?;
            let field_enabled = wire.field("enabled", lcm_wire::Wire::take)?;
            Ok(Self { timestamp: field_timestamp, position: field_position, orientation: field_orientation, num_ranges: field_num_ranges, ranges: field_ranges, name: field_name, enabled: field_enabled })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.timestamp = wire.field("timestamp", lcm_wire::Wire::take)?;
            self.position = wire.field("position", lcm_wire::Wire::take)?;
            self.orientation = wire.field("orientation", lcm_wire::Wire::take)?;
            self.num_ranges = wire.field("num_ranges", lcm_wire::Wire::take)?;
            wire.field("ranges", |wire| wire.refill(&mut self.ranges, "num_ranges", i64::from(self.num_ranges), 2, lcm_wire::Wire::take))?;
            wire.field("name", |wire| lcm_wire::Wire::retake(&mut self.name, wire))?;
            self.enabled = wire.field("enabled", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct ExampleList {
        pub n: i32,
        pub examples: ::std::vec::Vec<Example>,
    }

    impl ::std::default::Default for ExampleList {
        fn default() -> Self {
            Self {
                n: 0,
                examples: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for ExampleList {
        const TYPE: &'static str = "exlcm.example_list_t";
        const FINGERPRINT: u64 = 0xd8c37c52f0f62dac;
    }

    impl lcm_wire::Wire for ExampleList {
        const MIN_SIZE: usize = 4;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.n.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "examples", self.examples.len(), "n", i64::from(self.n))?;
            for item_0 in self.examples.iter() {
                item_0.put(out)?;
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_n = wire.field("n", lcm_wire::Wire::take)?;
            let field_examples = wire.field("examples", |wire| wire.list("n", i64::from(field_n), 74, |wire| wire.nested(lcm_wire::Wire::take)))?;
            Ok(Self { n: field_n, examples: field_examples })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.n = wire.field("n", lcm_wire::Wire::take)?;
            wire.field("examples", |wire| wire.retake_list(&mut self.examples, "n", i64::from(self.n), 74))?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct Node {
        pub num_children: i32,
        pub children: ::std::vec::Vec<Node>,
    }

    impl ::std::default::Default for Node {
        fn default() -> Self {
            Self {
                num_children: 0,
                children: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for Node {
        const TYPE: &'static str = "exlcm.node_t";
        const FINGERPRINT: u64 = 0x31fe946c75d6e4e7;
    }

    impl lcm_wire::Wire for Node {
        const MIN_SIZE: usize = 4;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.num_children.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "children", self.children.len(), "num_children", i64::from(self.num_children))?;
            for item_0 in self.children.iter() {
                item_0.put(out)?;
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_num_children = wire.field("num_children", lcm_wire::Wire::take)?;
            let field_children = wire.field("children", |wire| wire.list("num_children", i64::from(field_num_children), 4, |wire| wire.nested(lcm_wire::Wire::take)))?;
            Ok(Self { num_children: field_num_children, children: field_children })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.num_children = wire.field("num_children", lcm_wire::Wire::take)?;
            wire.field("children", |wire| wire.retake_list(&mut self.children, "num_children", i64::from(self.num_children), 4))?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct Exampleconst {
    }

    impl Exampleconst {
        pub const ABC: i32 = 1;
        pub const DEF: i32 = 2;
    }

    impl ::std::default::Default for Exampleconst {
        fn default() -> Self {
            Self {
            }
        }
    }

    impl lcm_wire::Message for Exampleconst {
        const TYPE: &'static str = "exlcm.exampleconst_t";
        const FINGERPRINT: u64 = 0x000000002468acf0;
    }

    impl lcm_wire::Wire for Exampleconst {
        const MIN_SIZE: usize = 0;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            Ok(Self {  })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct MuldimArray {
        pub size_a: i32,
        pub size_b: i32,
        pub size_c: i32,
        pub data: ::std::vec::Vec<::std::vec::Vec<::std::vec::Vec<i32>>>,
        pub strarray: [::std::vec::Vec<::std::string::String>; 2],
    }

    impl ::std::default::Default for MuldimArray {
        fn default() -> Self {
            Self {
                size_a: 0,
                size_b: 0,
                size_c: 0,
                data: ::std::vec::Vec::new(),
                strarray: ::std::array::from_fn(|_| ::std::vec::Vec::new()),
            }
        }
    }

    impl lcm_wire::Message for MuldimArray {
        const TYPE: &'static str = "exlcm.muldim_array_t";
        const FINGERPRINT: u64 = 0x3c0248e7bd699f76;
    }

    impl lcm_wire::Wire for MuldimArray {
        const MIN_SIZE: usize = 12;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.size_a.put(out)?;
            self.size_b.put(out)?;
            self.size_c.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "data", self.data.len(), "size_a", i64::from(self.size_a))?;
            for item_0 in self.data.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "data", item_0.len(), "size_b", i64::from(self.size_b))?;
                for item_1 in item_0.iter() {
                    lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "data", item_1.len(), "size_c", i64::from(self.size_c))?;
                    for item_2 in item_1.iter() {
                        item_2.put(out)?;
                    }
                }
            }
            for item_0 in self.strarray.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "strarray", item_0.len(), "size_c", i64::from(self.size_c))?;
                for item_1 in item_0.iter() {
                    item_1.put(out)?;
                }
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_size_a = wire.field("size_a", lcm_wire::Wire::take)?;
            let field_size_b = wire.field("size_b", lcm_wire::Wire::take)?;
            let field_size_c = wire.field("size_c", lcm_wire::Wire::take)?;
            let field_data = wire.field("data", |wire| wire.list("size_a", i64::from(field_size_a), lcm_wire::row_size(&[i64::from(field_size_b), i64::from(field_size_c)], 4), |wire| wire.list("size_b", i64::from(field_size_b), lcm_wire::row_size(&[i64::from(field_size_c)], 4), |wire| wire.list("size_c", i64::from(field_size_c), 4, lcm_wire::Wire::take))))?;
            let field_strarray = wire.field("strarray", |wire| wire.array(|wire| wire.list("size_c", i64::from(field_size_c), 5, lcm_wire::Wire::take)))?;
            Ok(Self { size_a: field_size_a, size_b: field_size_b, size_c: field_size_c, data: field_data, strarray: field_strarray })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.size_a = wire.field("size_a", lcm_wire::Wire::take)?;
            self.size_b = wire.field("size_b", lcm_wire::Wire::take)?;
            self.size_c = wire.field("size_c", lcm_wire::Wire::take)?;
            wire.field("data", |wire| wire.refill(&mut self.data, "size_a", i64::from(self.size_a), lcm_wire::row_size(&[i64::from(self.size_b), i64::from(self.size_c)], 4), |wire| wire.list("size_b", i64::from(self.size_b), lcm_wire::row_size(&[i64::from(self.size_c)], 4), |wire| wire.list("size_c", i64::from(self.size_c), 4, lcm_wire::Wire::take))))?;
            self.strarray = wire.field("strarray", |wire| wire.array(|wire| wire.list("size_c", i64::from(self.size_c), 5, lcm_wire::Wire::take)))?;
            Ok(())
        }
    }
}

/// Types of package `lcmtest`.
#[allow(missing_docs, reason = "the comment of a type says what its fields mean")]
#[allow(unused_variables, reason = "a type may have no field")]
#[allow(non_snake_case, non_upper_case_globals, clippy::all, rustdoc::all, reason = "names and texts are those of the .lcm")]
pub mod lcmtest {
    use ::lcm_idl::wire as lcm_wire;

    #[derive(Clone, Debug, PartialEq)]
    pub struct Primitives {
        pub i8: i8,
        pub i16: i16,
        pub num_ranges: i32,
        pub i64: i64,
        pub ranges: ::std::vec::Vec<i16>,
        pub position: [f32; 3],
        pub orientation: [f64; 4],
        pub name: ::std::string::String,
        pub enabled: bool,
    }

    impl ::std::default::Default for Primitives {
        fn default() -> Self {
            Self {
                i8: 0,
                i16: 0,
                num_ranges: 0,
                i64: 0,
                ranges: ::std::vec::Vec::new(),
                position: ::std::array::from_fn(|_| 0.0),
                orientation: ::std::array::from_fn(|_| 0.0),
                name: ::std::string::String::new(),
                enabled: false,
            }
        }
    }

    impl lcm_wire::Message for Primitives {
        const TYPE: &'static str = "lcmtest.primitives_t";
        const FINGERPRINT: u64 = 0x84e62b31229e6d55;
    }

    impl lcm_wire::Wire for Primitives {
        const MIN_SIZE: usize = 65;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.i8.put(out)?;
            self.i16.put(out)?;
            self.num_ranges.put(out)?;
            self.i64.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "ranges", self.ranges.len(), "num_ranges", i64::from(self.num_ranges))?;
            for item_0 in self.ranges.iter() {
                item_0.put(out)?;
            }
            self.position.put(out)?;
            self.orientation.put(out)?;
            self.name.put(out)?;
            self.enabled.put(out)?;
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_i8 = wire.field("i8", lcm_wire::Wire::take)?;
            let field_i16 = wire.field("i16", lcm_wire::Wire::take)?;
            let field_num_ranges = wire.field("num_ranges", lcm_wire::Wire::take)?;
            let field_i64 = wire.field("i64", lcm_wire::Wire::take)?;
            let field_ranges = wire.field("ranges", |wire| wire.list("num_ranges", i64::from(field_num_ranges), 2, lcm_wire::Wire::take))?;
            let field_position = wire.field("position", lcm_wire::Wire::take)?;
            let field_orientation = wire.field("orientation", lcm_wire::Wire::take)?;
            let field_name = wire.field("name", lcm_wire::Wire::take)?;
            let field_enabled = wire.field("enabled", lcm_wire::Wire::take)?;
            Ok(Self { i8: field_i8, i16: field_i16, num_ranges: field_num_ranges, i64: field_i64, ranges: field_ranges, position: field_position, orientation: field_orientation, name: field_name, enabled: field_enabled })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.i8 = wire.field("i8", lcm_wire::Wire::take)?;
            self.i16 = wire.field("i16", lcm_wire::Wire::take)?;
            self.num_ranges = wire.field("num_ranges", lcm_wire::Wire::take)?;
            self.i64 = wire.field("i64", lcm_wire::Wire::take)?;
            wire.field("ranges", |wire| wire.refill(&mut self.ranges, "num_ranges", i64::from(self.num_ranges), 2, lcm_wire::Wire::take))?;
            self.position = wire.field("position", lcm_wire::Wire::take)?;
            self.orientation = wire.field("orientation", lcm_wire::Wire::take)?;
            wire.field("name", |wire| lcm_wire::Wire::retake(&mut self.name, wire))?;
            self.enabled = wire.field("enabled", lcm_wire::Wire::take)?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct PrimitivesList {
        pub num_items: i32,
        pub items: ::std::vec::Vec<Primitives>,
    }

    impl ::std::default::Default for PrimitivesList {
        fn default() -> Self {
            Self {
                num_items: 0,
                items: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for PrimitivesList {
        const TYPE: &'static str = "lcmtest.primitives_list_t";
        const FINGERPRINT: u64 = 0x678ad0708ed803c0;
    }

    impl lcm_wire::Wire for PrimitivesList {
        const MIN_SIZE: usize = 4;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.num_items.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "items", self.items.len(), "num_items", i64::from(self.num_items))?;
            for item_0 in self.items.iter() {
                item_0.put(out)?;
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_num_items = wire.field("num_items", lcm_wire::Wire::take)?;
            let field_items = wire.field("items", |wire| wire.list("num_items", i64::from(field_num_items), 65, |wire| wire.nested(lcm_wire::Wire::take)))?;
            Ok(Self { num_items: field_num_items, items: field_items })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.num_items = wire.field("num_items", lcm_wire::Wire::take)?;
            wire.field("items", |wire| wire.retake_list(&mut self.items, "num_items", i64::from(self.num_items), 65))?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct Bools {
        pub one_bool: bool,
        pub fixed_array: [bool; 3],
        pub num_a: i8,
        pub num_b: i8,
        pub one_dim_array: ::std::vec::Vec<bool>,
        pub two_dim_array: ::std::vec::Vec<::std::vec::Vec<bool>>,
    }

    impl ::std::default::Default for Bools {
        fn default() -> Self {
            Self {
                one_bool: false,
                fixed_array: ::std::array::from_fn(|_| false),
                num_a: 0,
                num_b: 0,
                one_dim_array: ::std::vec::Vec::new(),
                two_dim_array: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for Bools {
        const TYPE: &'static str = "lcmtest.bools_t";
        const FINGERPRINT: u64 = 0x239fecd5036a5707;
    }

    impl lcm_wire::Wire for Bools {
        const MIN_SIZE: usize = 6;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.one_bool.put(out)?;
            self.fixed_array.put(out)?;
            self.num_a.put(out)?;
            self.num_b.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "one_dim_array", self.one_dim_array.len(), "num_a", i64::from(self.num_a))?;
            for item_0 in self.one_dim_array.iter() {
                item_0.put(out)?;
            }
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "two_dim_array", self.two_dim_array.len(), "num_a", i64::from(self.num_a))?;
            for item_0 in self.two_dim_array.iter() {
                lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "two_dim_array", item_0.len(), "num_b", i64::from(self.num_b))?;
                for item_1 in item_0.iter() {
                    item_1.put(out)?;
                }
            }
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_one_bool = wire.field("one_bool", lcm_wire::Wire::take)?;
            let field_fixed_array = wire.field("fixed_array", lcm_wire::Wire::take)?;
            let field_num_a = wire.field("num_a", lcm_wire::Wire::take)?;
            let field_num_b = wire.field("num_b", lcm_wire::Wire::take)?;
            let field_one_dim_array = wire.field("one_dim_array", |wire| wire.list("num_a", i64::from(field_num_a), 1, lcm_wire::Wire::take))?;
            let field_two_dim_array = wire.field("two_dim_array", |wire| wire.list("num_a", i64::from(field_num_a), lcm_wire::row_size(&[i64::from(field_num_b)], 1), |wire| wire.list("num_b", i64::from(field_num_b), 1, lcm_wire::Wire::take)))?;
            Ok(Self { one_bool: field_one_bool, fixed_array: field_fixed_array, num_a: field_num_a, num_b: field_num_b, one_dim_array: field_one_dim_array, two_dim_array: field_two_dim_array })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.one_bool = wire.field("one_bool", lcm_wire::Wire::take)?;
            self.fixed_array = wire.field("fixed_array", lcm_wire::Wire::take)?;
            self.num_a = wire.field("num_a", lcm_wire::Wire::take)?;
            self.num_b = wire.field("num_b", lcm_wire::Wire::take)?;
            wire.field("one_dim_array", |wire| wire.refill(&mut self.one_dim_array, "num_a", i64::from(self.num_a), 1, lcm_wire::Wire::take))?;
            wire.field("two_dim_array", |wire| wire.refill(&mut self.two_dim_array, "num_a", i64::from(self.num_a), lcm_wire::row_size(&[i64::from(self.num_b)], 1), |wire| wire.list("num_b", i64::from(self.num_b), 1, lcm_wire::Wire::take)))?;
            Ok(())
        }
    }

    #[derive(Clone, Debug, PartialEq)]
    pub struct ByteArray {
        pub num_bytes: i32,
        pub data: ::std::vec::Vec<u8>,
    }

    impl ::std::default::Default for ByteArray {
        fn default() -> Self {
            Self {
                num_bytes: 0,
                data: ::std::vec::Vec::new(),
            }
        }
    }

    impl lcm_wire::Message for ByteArray {
        const TYPE: &'static str = "lcmtest.byte_array_t";
        const FINGERPRINT: u64 = 0x0e18e8efc4e1bd7f;
    }

    impl lcm_wire::Wire for ByteArray {
        const MIN_SIZE: usize = 4;

        fn put(&self, out: &mut ::std::vec::Vec<u8>) -> ::std::result::Result<(), ::lcm_idl::EncodeError> {
            self.num_bytes.put(out)?;
            lcm_wire::check_length(<Self as lcm_wire::Message>::TYPE, "data", self.data.len(), "num_bytes", i64::from(self.num_bytes))?;
            out.extend_from_slice(&self.data);
            Ok(())
        }

        fn take(wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<Self, ::lcm_idl::DecodeError> {
            let field_num_bytes = wire.field("num_bytes", lcm_wire::Wire::take)?;
            let field_data = wire.field("data", |wire| wire.byte_list("num_bytes", i64::from(field_num_bytes)).map(<[u8]>::to_vec))?;
            Ok(Self { num_bytes: field_num_bytes, data: field_data })
        }

        fn retake(&mut self, wire: &mut lcm_wire::Reader<'_>) -> ::std::result::Result<(), ::lcm_idl::DecodeError> {
            self.num_bytes = wire.field("num_bytes", lcm_wire::Wire::take)?;
            let bytes = wire.field("data", |wire| wire.byte_list("num_bytes", i64::from(self.num_bytes)))?;
            self.data.clear();
            self.data.extend_from_slice(bytes);
            Ok(())
        }
    }
}
