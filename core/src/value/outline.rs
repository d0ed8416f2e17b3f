//! What is remembered of a value when its bytes are not at hand.

use std::collections::BTreeSet;
use std::fmt;

use super::{Digest, Hasher, Kind, Value, Windows};

/// Which part of a value a port looks at; what it does not look at does not enter the reader's key.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Reads {
    /// All of it.
    All,
    /// Windows and pixel aspect only.
    Windows,
    /// Windows and those channels of an image's first layer, as far as they are there.
    Channels(Vec<String>),
}

/// A value's digest tree, and the little that planning needs: enough to make every reader's key.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Outline {
    /// Digest of the whole value.
    pub digest: Digest,
    /// Where it lies, for kinds that lie somewhere.
    pub windows: Option<Windows>,
    /// Digest of each channel of an image's first layer.
    pub channels: Vec<(String, Digest)>,
    /// The number, of a Number: links are parameters by value.
    pub number: Option<f64>,
    /// Memory the value takes.
    pub bytes: u64,
    /// Whether its bytes can go to disk.
    pub storable: bool,
}

impl Outline {
    /// The outline of `value`.
    pub fn of(value: &Value) -> Self {
        let channels = match value {
            Value::Image(image) => {
                image.primary().channels.iter().map(|channel| (channel.name.to_string(), channel.digest())).collect()
            }
            _ => Vec::new(),
        };
        let number = match value {
            Value::Number(number) => Some(*number),
            _ => None,
        };
        Self {
            digest: value.digest(),
            windows: value.windows(),
            channels,
            number,
            bytes: value.bytes(),
            storable: value.is_storable(),
        }
    }

    /// Digest of the part that `reads` names.
    pub fn part(&self, reads: &Reads) -> Digest {
        match (reads, &self.windows) {
            (Reads::All, _) | (_, None) => self.digest,
            (Reads::Windows, Some(windows)) => windows.digest(),
            (Reads::Channels(names), Some(windows)) => {
                let mut hasher = Hasher::new("channels");
                hasher.digest(&windows.digest());
                for (name, digest) in self.channels.iter().filter(|(name, _)| names.contains(name)) {
                    hasher.text(name).digest(digest);
                }
                hasher.finish()
            }
        }
    }
}

/// What a node is given of an input: no more than its key holds.
#[derive(Clone, Debug)]
pub enum Given {
    /// The value, or of an image what is read of it.
    Value(Value),
    /// Where it lies.
    Windows(Windows),
}

impl Reads {
    /// What is left of `value` when what is not read is taken away.
    pub fn restrict(&self, value: &Value) -> Given {
        match (self, value, value.windows()) {
            (Reads::Windows, _, Some(windows)) => Given::Windows(windows),
            (Reads::Channels(names), Value::Image(image), _) => Given::Value(image.with_channels_only(names).into()),
            _ => Given::Value(value.clone()),
        }
    }

    /// The channels of an image's first layer that are read; none where that is the whole image.
    pub fn channels(&self) -> Option<&[String]> {
        match self {
            Reads::All => None,
            Reads::Windows => Some(&[]),
            Reads::Channels(names) => Some(names),
        }
    }

    /// What readers look at together, the same whichever comes first; without readers the windows.
    pub fn union<'a>(readers: impl IntoIterator<Item = &'a Self>) -> Self {
        let names: Option<Vec<&[String]>> = readers.into_iter().map(Reads::channels).collect();
        let Some(names) = names else { return Reads::All };
        let names: BTreeSet<&String> = names.into_iter().flatten().collect();
        match names.is_empty() {
            true => Reads::Windows,
            false => Reads::Channels(names.into_iter().cloned().collect()),
        }
    }

    /// What the outline alone can give.
    pub fn without_value(&self, outline: &Outline) -> Option<Given> {
        match self {
            Reads::Windows => outline.windows.map(Given::Windows),
            _ => None,
        }
    }

    /// Only images have channels, and only what has pixels has windows; of other kinds all is read.
    pub fn for_kind(self, kind: Kind) -> Self {
        match self {
            Reads::Channels(_) if kind != Kind::Image => Reads::All,
            Reads::Windows if !matches!(kind, Kind::Image | Kind::Mask | Kind::Field | Kind::Labels) => Reads::All,
            reads => reads,
        }
    }
}

impl fmt::Display for Reads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reads::All => write!(f, "all"),
            Reads::Windows => write!(f, "windows"),
            Reads::Channels(names) => write!(f, "channels {}", names.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Reads::{self, All, Windows};

    fn channels(names: &[&str]) -> Reads {
        Reads::Channels(names.iter().map(|name| name.to_string()).collect())
    }

    #[test]
    fn the_union_holds_both_and_has_one_form() {
        let (rg, ba) = (channels(&["R", "G"]), channels(&["B", "A", "R"]));
        assert_eq!(Reads::union([&rg, &ba]), channels(&["A", "B", "G", "R"]));
        for reads in [All, Windows, rg.clone(), ba] {
            assert_eq!(Reads::union([&reads, &All]), All);
            assert_eq!(Reads::union([&reads, &rg]), Reads::union([&rg, &reads]));
            assert_eq!(Reads::union([&reads, &Windows]), Reads::union([&reads]), "windows add nothing");
        }
        assert_eq!(Reads::union([&channels(&[]), &Windows]), Windows);
        assert_eq!(Reads::union([]), Windows, "without readers");
    }
}
