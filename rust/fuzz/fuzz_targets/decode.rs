//! Whatever bytes are given, of either format and with any folds: the decoder refuses them, with the same error on every instruction
//! set, or they are the one stream of the material that it finds. What is found in format 1 is the same in format 2.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sommerl_codec::{InstructionSet, Layout, decode, encode};

fuzz_target!(|data: &[u8]| {
    // The first byte says of which format it is, and how it is folded.
    let (what, data) = data.split_first().unwrap_or((&0, data));
    let (reciprocal, mirrored) = (what & 1 == 0, what & 2 != 0);
    let first = what & 4 != 0;
    let layout = if first { Layout::First } else { Layout::Second { reciprocal, mirrored } };
    let found = decode(data, layout, InstructionSet::PORTABLE);
    assert_eq!(found, decode(data, layout, InstructionSet::fastest()));
    if let Ok(material) = found {
        let again = encode(&material, InstructionSet::fastest());
        if first {
            let layout = Layout::Second { reciprocal: true, mirrored: false };
            let read = again.and_then(|again| decode(&again, layout, InstructionSet::fastest()));
            assert_eq!(read, Ok(material));
        } else {
            assert_eq!(again.as_deref(), Ok(data));
        }
    }
});
