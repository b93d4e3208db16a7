//! A hint that memory is about to be read.

/// Bytes of a cache line.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Asks the processor to bring `LINES` cache lines near, from byte `offset` of `table` on, which is read soon. A hint: it
/// changes no result and may reach beyond the table. Does nothing on other processors than x86-64, where nobody has
/// measured it.
#[inline(always)]
pub fn prefetch<const LINES: usize>(table: &[u8], offset: usize) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..LINES {
        let address = table.as_ptr().wrapping_add(offset).wrapping_add(line * LINE).cast();
        // SAFETY: an instruction of every x86-64 processor that gives no value and never faults, whatever the address.
        #[expect(unsafe_code, reason = "the function is unsafe only for its pointer")]
        unsafe {
            core::arch::x86_64::_mm_prefetch::<{ core::arch::x86_64::_MM_HINT_T0 }>(address);
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (table, offset);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hints may point anywhere. Killed by: an address that is read, or computed with a check for overflow.
    #[test]
    fn no_address_is_wrong() {
        let table = [1u8; 100];
        for offset in [0, 99, 100, usize::MAX / 2, usize::MAX - 1] {
            prefetch::<5>(&table, offset);
            prefetch::<5>(&[], offset);
        }
        assert_eq!(table, [1; 100]);
    }
}
