//! Reading of files that a user names: parameters, scenarios, URDFs, `.lcm` texts.

use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Size of the largest file that is read, bytes. The largest public URDFs have less than 1 MiB.
const MAX_BYTES: u64 = 64 << 20;

/// Reads a text file.
///
/// # Errors
/// Those of the file system; [`ErrorKind::InvalidData`] if it is not UTF-8; [`ErrorKind::FileTooLarge`] above 64 MiB, also of a device without end.
pub fn read_text(path: &Path) -> Result<String> {
    text_of(std::fs::File::open(path)?)
}

/// Reads the text of an open file or pipe.
///
/// # Errors
/// As [`read_text`].
pub fn text_of(source: impl Read) -> Result<String> {
    let bytes = limited(source)?;
    String::from_utf8(bytes).map_err(|_| Error::new(ErrorKind::InvalidData, "found bytes that are not UTF-8 text"))
}

/// Reads a text file; bytes that are not UTF-8, as in comments in Latin-1, become U+FFFD.
///
/// # Errors
/// Those of the file system; [`ErrorKind::FileTooLarge`] as [`read_text`].
pub fn read_text_lossy(path: &Path) -> Result<String> {
    Ok(String::from_utf8_lossy(&limited(std::fs::File::open(path)?)?).into_owned())
}

fn limited(source: impl Read) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::new(ErrorKind::FileTooLarge, "more than 64 MiB, expected a text file"));
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(Error::new(ErrorKind::InvalidData, "the text is UTF-16, expected UTF-8"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf_16_is_an_error() {
        for bytes in [&[0xFF, 0xFE, b'<', 0][..], &[0xFE, 0xFF, 0, b'<']] {
            assert_eq!(text_of(bytes).unwrap_err().kind(), ErrorKind::InvalidData);
            assert_eq!(limited(bytes).unwrap_err().kind(), ErrorKind::InvalidData);
        }
        assert_eq!(text_of(&b"<robot/>"[..]).unwrap(), "<robot/>");
    }

    #[test]
    fn a_source_without_end_is_an_error() {
        assert_eq!(read_text(Path::new("/dev/zero")).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_text_lossy(Path::new("/dev/zero")).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(text_of(std::io::repeat(b' ')).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }

    #[test]
    fn text_is_read_and_other_bytes_are_an_error() {
        assert_eq!(text_of("é".as_bytes()).unwrap(), "é");
        assert_eq!(text_of(&b"\xe9"[..]).unwrap_err().kind(), ErrorKind::InvalidData);
        assert_eq!(read_text(Path::new("/nonexistent/file")).unwrap_err().kind(), ErrorKind::NotFound);
    }
}
