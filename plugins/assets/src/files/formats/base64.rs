//! Base64 of data URIs (RFC 4648, standard and URL-safe alphabets).

use syntable_model::error::{Error, Result};

/// Decodes text. Line breaks and blanks are passed over; padding is optional.
pub fn decode(text: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0_u32, 0);
    let mut padded = false;
    for (i, letter) in text.bytes().enumerate() {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => {
                padded = true;
                continue;
            }
            b' ' | b'\n' | b'\r' | b'\t' => continue,
            _ => 64,
        };
        if value == 64 || padded {
            return Err(Error::new(format!("letter {i} of the base64 data is wrong")));
        }
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    if held >= 6 {
        return Err(Error::new("the base64 data is cut short"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vectors_of_rfc_4648() {
        for (text, want) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob"), ("Zm9v\nYmFy", "foobar")]
        {
            assert_eq!(decode(text).expect(text), want.as_bytes(), "{text}");
        }
        assert!(decode("Zm9*").is_err() && decode("Zg==Zg==").is_err() && decode("A").is_err());
    }
}
