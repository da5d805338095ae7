//! The seal of a hidden effect: `rig.json` keeps the effect encrypted, and the seed of `run --hide` opens it.
//!
//! It is a game that trains and tests, not a secret: seeds are small numbers, and who tries them all finds the right one. The seal
//! keeps a reader of the folder from seeing the effect by accident, and it keeps the effect itself, so that a catalogue that has grown
//! since does not change it.
//!
//! # Construction
//! Deterministic authenticated encryption with a synthetic initialisation vector (Rogaway and Shrimpton 2006): the
//! same seed and effect give the same file. Two keys are the SHA-256 of a label and the seed. The tag is the HMAC-SHA256 of the padded
//! effect under the first key. The HMAC of the tag under the second key is the key of a ChaCha20 stream, which is added to the padded
//! effect. To open a seal is to decrypt it and to compare the tag. The padding hides the length, which would tell the mechanism.

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::hidden_effect::draw_unsealed_effect;
use super::mechanism_list::MechanismList;
use crate::wrist::Lever;

/// The hidden effect as `rig.json` keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Seal {
    /// The effect, encrypted.
    Effect(SealedEffect),
    /// A digest of the seed alone, as earlier versions wrote it: the effect is drawn again from the catalogue of that time.
    SeedOnly(SealedSeed),
}

/// An encrypted effect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedEffect {
    /// HMAC-SHA256 of the padded effect, hexadecimal.
    tag: String,
    /// The padded effect plus the key stream, hexadecimal.
    sealed: String,
}

/// The digest of a seed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedSeed {
    seal_sha256: String,
}

/// Why a seal does not open.
#[derive(Debug, thiserror::Error)]
pub enum SealError {
    /// The seed is another one, or the seal was changed.
    #[error("the seed does not open it")]
    WrongSeed,
    /// The catalogue of this version does not have the mechanism.
    #[error("its hidden effect is not one of this version of ramphold: {0}")]
    Unknown(#[source] serde_json::Error),
}

/// Length to which an effect is padded, in bytes: a multiple of this number.
const PADDING: usize = 512;

impl Seal {
    /// Seals `effect` with `seed`.
    pub fn new(seed: u64, effect: &MechanismList) -> Self {
        let mut text = serde_json::to_vec(effect).expect("a list of mechanisms is JSON");
        text.resize(text.len().next_multiple_of(PADDING), b' ');
        let tag = hmac(&key(seed, "tag"), &text);
        let sealed = add_key_stream(seed, &tag, &text);
        Self::Effect(SealedEffect { tag: hex(&tag), sealed: hex(&sealed) })
    }

    /// Opens the seal with `seed`; the effect, in a wrist with this lever.
    ///
    /// # Errors
    /// If the seed is not the one that sealed it, or if this version does not know the mechanism.
    pub fn open(&self, seed: u64, lever: Option<Lever>) -> Result<MechanismList, SealError> {
        match self {
            Self::SeedOnly(SealedSeed { seal_sha256 }) => {
                let digest = hex(&Sha256::digest(format!("ramphold hides {seed}")));
                if *seal_sha256 != digest {
                    return Err(SealError::WrongSeed);
                }
                Ok(draw_unsealed_effect(seed, lever))
            }
            Self::Effect(SealedEffect { tag, sealed }) => {
                let (tag, sealed) = unhex(tag).zip(unhex(sealed)).ok_or(SealError::WrongSeed)?;
                let text = add_key_stream(seed, &tag, &sealed);
                if hmac(&key(seed, "tag"), &text)[..] != tag[..] {
                    return Err(SealError::WrongSeed);
                }
                serde_json::from_slice(&text).map_err(SealError::Unknown)
            }
        }
    }
}

/// The key for one purpose.
fn key(seed: u64, purpose: &str) -> [u8; 32] {
    Sha256::new()
        .chain_update(b"ramphold seal 2\0")
        .chain_update(seed.to_le_bytes())
        .chain_update(purpose.as_bytes())
        .finalize()
        .into()
}

/// HMAC-SHA256 (RFC 2104) with a key of 32 bytes.
fn hmac(key: &[u8; 32], message: &[u8]) -> [u8; 32] {
    let pad = |byte: u8| {
        let mut block = [byte; 64];
        block.iter_mut().zip(key).for_each(|(own, key)| *own ^= key);
        block
    };
    let inner = Sha256::new().chain_update(pad(0x36)).chain_update(message).finalize();
    Sha256::new().chain_update(pad(0x5c)).chain_update(inner).finalize().into()
}

/// `bytes` plus (exclusive or) the key stream of `seed` and `tag`; applied twice it gives `bytes`.
fn add_key_stream(seed: u64, tag: &[u8], bytes: &[u8]) -> Vec<u8> {
    let mut stream = vec![0; bytes.len()];
    ChaCha20Rng::from_seed(hmac(&key(seed, "stream"), tag)).fill_bytes(&mut stream);
    stream.iter().zip(bytes).map(|(key, byte)| key ^ byte).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16).map(|digit| digit as u8);
    let pairs = text.as_bytes().chunks(2);
    pairs.map(|pair| Some(digit(pair[0])? << 4 | digit(*pair.get(1)?)?)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::hidden_effect::draw_hidden_effect;
    use super::*;

    const LEVER: Option<Lever> =
        Some(Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 });

    #[test]
    fn a_seal_gives_back_the_effect_to_its_seed_and_to_no_other() {
        for seed in 0..40 {
            let effect = draw_hidden_effect(seed, LEVER);
            let text = serde_json::to_string(&Seal::new(seed, &effect)).unwrap();
            let seal: Seal = serde_json::from_str(&text).unwrap();
            assert_eq!(seal.open(seed, LEVER).unwrap(), effect);
            assert!(matches!(seal.open(seed + 1, LEVER), Err(SealError::WrongSeed)));
        }
    }

    #[test]
    fn a_seal_that_was_changed_does_not_open() {
        let Seal::Effect(sealed) = Seal::new(3, &draw_hidden_effect(3, LEVER)) else { unreachable!() };
        let mut changed = sealed.clone();
        let flipped = if sealed.sealed.starts_with('0') { "1" } else { "0" };
        changed.sealed.replace_range(..1, flipped);
        assert!(matches!(Seal::Effect(changed).open(3, LEVER), Err(SealError::WrongSeed)));
    }

    #[test]
    fn the_length_of_a_seal_does_not_tell_the_mechanism() {
        let lengths: Vec<usize> = (0..60)
            .map(|seed| {
                serde_json::to_string(&Seal::new(seed, &draw_hidden_effect(seed, LEVER))).unwrap().len()
            })
            .collect();
        assert!(lengths.iter().all(|length| *length == lengths[0]), "{lengths:?}");
    }

    #[test]
    fn the_tag_is_the_hmac_of_rfc_4231() {
        // Test case 2 with its key padded to 32 bytes by zeros, as HMAC does itself.
        let mut key = [0; 32];
        key[..4].copy_from_slice(b"Jefe");
        let expected = "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843";
        assert_eq!(hex(&hmac(&key, b"what do ya want for nothing?")), expected);
    }

    #[test]
    fn a_seal_of_an_earlier_version_opens_with_its_seed() {
        // From a session that was hidden with --hide 7 before effects were sealed.
        let text = r#"{"seal_sha256": "879142e826498fd685a48bf278ccecc37f6d1e940bfa4240cdc2467d7af308ea"}"#;
        let seal: Seal = serde_json::from_str(text).unwrap();
        assert_eq!(seal.open(7, LEVER).unwrap(), draw_unsealed_effect(7, LEVER));
        assert!(matches!(seal.open(8, LEVER), Err(SealError::WrongSeed)));
    }
}
