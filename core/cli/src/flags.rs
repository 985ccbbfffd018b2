//! Flags of the command line in messages of the library.
//!
//! A function of the library has no flags. Its errors name an option by its field, as `` `options.retry_failed` ``. The
//! command line prints the flag, as `--retry-failed`: each flag has the name of its field, with hyphens.

use std::borrow::Cow;

/// Start of the name of an option in a message.
const FIELD: &str = "`options.";

/// A message with flags for the options that it names.
pub fn with_flags(message: &str) -> Cow<'_, str> {
    with_options(message, |name| format!("--{}", name.replace('_', "-")))
}

/// A message in which `option` names the options: it gets the name of each option's field.
pub fn with_options(message: &str, option: impl Fn(&str) -> String) -> Cow<'_, str> {
    let mut parts = message.split(FIELD);
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once('`').filter(|(name, _)| is_field(name)) {
            Some((name, rest)) => text += &format!("{}{rest}", option(name)),
            None => text += &format!("{FIELD}{part}"),
        }
    }
    if text == message { Cow::Borrowed(message) } else { Cow::Owned(text) }
}

fn is_field(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_')
}

#[cfg(test)]
mod tests {
    use super::with_flags;

    #[test]
    fn options_become_flags() {
        for (message, printed) in [
            ("`options.to` npy: unknown kind", "--to npy: unknown kind"),
            ("use `options.out` or `options.retry_failed`", "use --out or --retry-failed"),
            ("`options.`, `options.Out` and `options.out", "`options.`, `options.Out` and `options.out"),
            ("`write.png.options.out` stays", "`write.png.options.out` stays"),
            ("no option", "no option"),
        ] {
            assert_eq!(with_flags(message), printed);
        }
    }
}
