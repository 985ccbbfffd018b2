//! Credentials and the region of the command `aws`, from its files.

use std::env;
use std::fs;
use std::path::PathBuf;
use syntable_model::error::{Error, Result};

/// A profile in `~/.aws/credentials` and `~/.aws/config`.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Profile {
    pub key_id: Option<String>,
    pub secret: Option<String>,
    pub token: Option<String>,
    pub region: Option<String>,
}

impl Profile {
    /// The profile that `AWS_PROFILE` names, or `default`; none if no file has it.
    ///
    /// # Errors
    /// If `AWS_PROFILE` names a profile that no file has, or whose file cannot be read.
    pub fn of_environment() -> Result<Option<Self>> {
        let named = env::var("AWS_PROFILE").ok().filter(|name| !name.is_empty());
        let name = named.as_deref().unwrap_or("default");
        let file = |variable: &str, name: &str| {
            let given = env::var_os(variable).map(PathBuf::from);
            given.or_else(|| Some(env::home_dir()?.join(".aws").join(name)))
        };
        let read = |path: Option<PathBuf>| match path.map(|path| (fs::read_to_string(&path), path)) {
            Some((Ok(text), _)) => Ok(text),
            // A container often has the home folder of another user.
            Some((Err(error), path)) if named.is_some() && error.kind() != std::io::ErrorKind::NotFound => {
                Err(Error::io(path, &error)
                    .help("AWS_PROFILE names a profile: make its file readable, or unset AWS_PROFILE"))
            }
            _ => Ok(String::new()),
        };
        let config = read(file("AWS_CONFIG_FILE", "config"))?;
        let credentials = read(file("AWS_SHARED_CREDENTIALS_FILE", "credentials"))?;
        let found = Self::of(name, &config, &credentials);
        match named {
            Some(name) if found.is_none() => {
                Err(Error::new(format!("AWS_PROFILE is {name:?}, and no file of `aws` has this profile"))
                    .help("`aws configure list-profiles` lists them"))
            }
            _ => Ok(found),
        }
    }

    /// A profile in the texts of both files. Keys of `credentials` take precedence.
    fn of(name: &str, config: &str, credentials: &str) -> Option<Self> {
        let mut profile = Self::default();
        let in_config = if name == "default" { name.to_owned() } else { format!("profile {name}") };
        let both = [profile.read(&in_config, config), profile.read(name, credentials)];
        both.contains(&true).then_some(profile)
    }

    /// Reads the section of a file. Returns whether the file has it.
    fn read(&mut self, section: &str, text: &str) -> bool {
        let (mut inside, mut found) = (false, false);
        for line in text.lines().map(str::trim).filter(|line| !line.starts_with(['#', ';'])) {
            if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
                inside = name.trim() == section;
                found |= inside;
            } else if let Some((key, value)) = line.split_once('=').filter(|_| inside) {
                let field = match key.trim() {
                    "aws_access_key_id" => &mut self.key_id,
                    "aws_secret_access_key" => &mut self.secret,
                    "aws_session_token" => &mut self.token,
                    "region" => &mut self.region,
                    _ => continue,
                };
                *field = Some(value.trim().to_owned());
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_are_read_from_both_files() {
        let config = "[default]\nregion = eu-west-1\n[profile lab]\nregion=us-east-2\n# aws_session_token = no\n";
        let credentials =
            "[default]\naws_access_key_id = A\naws_secret_access_key = b=\n\n[lab]\naws_access_key_id=C\n";
        let text = |text: &str| Some(text.to_owned());
        let default = Profile { key_id: text("A"), secret: text("b="), token: None, region: text("eu-west-1") };
        assert_eq!(Profile::of("default", config, credentials), Some(default));
        let lab = Profile { key_id: text("C"), region: text("us-east-2"), ..Profile::default() };
        assert_eq!(Profile::of("lab", config, credentials), Some(lab));
        assert_eq!(Profile::of("other", config, credentials), None);
    }
}
