//! Whatever bytes are given: the decoder refuses them, with the same error on every instruction set, or they are the one stream of
//! the material that it finds.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sommerl_codec::{InstructionSet, decode, encode};

fuzz_target!(|data: &[u8]| {
    let found = decode(data, InstructionSet::PORTABLE);
    assert_eq!(found, decode(data, InstructionSet::fastest()));
    if let Ok(material) = found {
        assert_eq!(encode(&material, InstructionSet::fastest()).as_deref(), Ok(data));
    }
});
