//! The parser of the LCM type language accepts any text, and the decoder of the parsed types any message: no panic, bounded time.
//! The text ends at the first NUL byte, the message follows.
#![no_main]

use lcm_idl::TypeSet;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let (text, message) = bytes.split_at(bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len()));
    let Ok(text) = std::str::from_utf8(text) else { return };
    let Ok(types) = TypeSet::parse([("fuzz", text)]) else { return };
    for ty in types.types() {
        let message = [&ty.fingerprint().to_be_bytes(), message].concat();
        if let Ok(value) = ty.decode(&message) {
            assert_eq!(ty.encode(&value).expect("a decoded value"), message, "{}", ty.name());
        }
    }
});
