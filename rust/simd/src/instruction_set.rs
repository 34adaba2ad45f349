//! The choice of an instruction set when the program runs.

/// An instruction set that this processor has: values of other ones cannot be made.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct InstructionSet(Kind);

/// The instruction sets that functions are compiled for. Each one includes those before it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Kind {
    /// What every processor of the target has, such as SSE2 or NEON.
    Portable,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, DQ and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl InstructionSet {
    /// The one that every processor has.
    pub const PORTABLE: InstructionSet = InstructionSet(Kind::Portable);

    /// Those that this processor has, slowest first.
    pub fn available() -> impl DoubleEndedIterator<Item = InstructionSet> {
        #[cfg(target_arch = "x86_64")]
        let others = [
            std::is_x86_feature_detected!("avx2").then_some(Kind::Avx2),
            // The first processors with AVX-512 lack DQ and VL.
            (std::is_x86_feature_detected!("avx2")
                && std::is_x86_feature_detected!("avx512f")
                && std::is_x86_feature_detected!("avx512dq")
                && std::is_x86_feature_detected!("avx512vl"))
            .then_some(Kind::Avx512),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let others = [];
        std::iter::once(Self::PORTABLE).chain(others.into_iter().flatten().map(InstructionSet))
    }

    /// The fastest one that this processor has.
    pub fn fastest() -> InstructionSet {
        Self::available().next_back().unwrap_or(Self::PORTABLE)
    }

    /// "portable", "avx2" or "avx512".
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => "avx512",
        }
    }

    /// Which one it is.
    pub fn kind(self) -> Kind {
        self.0
    }
}

/// Defines a function whose body is compiled once for each instruction set, and which runs the one that its first argument,
/// an `InstructionSet`, chooses. That argument is not listed:
///
/// ```
/// sommerl_simd::for_each_instruction_set! {
///     /// The sum of all numbers.
///     fn sum(numbers: &[u32]) -> u32 {
///         numbers.iter().sum()
///     }
/// }
/// assert_eq!(sum(sommerl_simd::InstructionSet::fastest(), &[1, 2, 3]), 6);
/// ```
///
/// After `up to avx2:` the function uses AVX2 where there is AVX-512.
///
/// In the body, `Lanes` is the implementation of `Simd` for the instruction set. Functions that the body calls are compiled for
/// the instruction set only where they are inlined: mark them `#[inline(always)]`.
#[macro_export]
macro_rules! for_each_instruction_set {
    (up to avx2: $($function:tt)*) => {
        $crate::for_each_instruction_set! { widest avx2: $($function)* }
    };
    (
        widest $widest:ident:
        $(#[$attribute:meta])*
        fn $name:ident $(<$generic:ident: $bound:path>)? ($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?
        $body:block
    ) => {
        $(#[$attribute])*
        fn $name $(<$generic: $bound>)? (set: $crate::InstructionSet, $($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn portable $(<$generic: $bound>)? ($($argument: $type),*) $(-> $result)? {
                #[allow(dead_code)]
                type Lanes = $crate::Portable;
                $body
            }

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            fn avx2 $(<$generic: $bound>)? ($($argument: $type),*) $(-> $result)? {
                #[allow(dead_code)]
                type Lanes = $crate::Avx2;
                $body
            }

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512dq,avx512vl")]
            #[allow(dead_code)]
            fn avx512 $(<$generic: $bound>)? ($($argument: $type),*) $(-> $result)? {
                #[allow(dead_code)]
                type Lanes = $crate::Avx512;
                $body
            }

            match set.kind() {
                $crate::Kind::Portable => portable($($argument),*),
                // SAFETY: an `InstructionSet` is only ever one that this processor has.
                #[cfg(target_arch = "x86_64")]
                $crate::Kind::Avx2 => unsafe { avx2($($argument),*) },
                // SAFETY: likewise; what has AVX-512 has AVX2.
                #[cfg(target_arch = "x86_64")]
                $crate::Kind::Avx512 => unsafe { $widest($($argument),*) },
            }
        }
    };
    ($($function:tt)*) => {
        $crate::for_each_instruction_set! { widest avx512: $($function)* }
    };
}
