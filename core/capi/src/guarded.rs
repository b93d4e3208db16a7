//! Objects in the caller's memory: a mark that tells live ones from dead and from other bytes, and a lock that never
//! waits. Calls that may run together share an object; one that excludes others, or is excluded, fails with
//! `CROUPIER_BUSY` where it would have to wait.

use crate::fault::Fault;
use crate::memory::checked;
use crate::status::croupier_status::*;
use core::cell::UnsafeCell;
use core::ops::{Deref, DerefMut};
use core::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

/// What an object is.
pub(crate) trait Kind {
    /// Mark of live objects; its complement marks dead ones.
    const MARK: u32;
    /// Name in messages.
    const NAME: &'static str;
}

/// Value of `users` while one call has the object for itself.
const EXCLUSIVE: u32 = u32::MAX;

/// What every object begins with. Any bytes are a head.
#[repr(C)]
struct Head {
    mark: AtomicU32,
    /// Calls that share the object, or [`EXCLUSIVE`].
    users: AtomicU32,
    /// Address of the object: what was copied elsewhere is none.
    own: AtomicUsize,
}

/// An object with its head.
#[repr(C)]
pub(crate) struct Guarded<T> {
    head: Head,
    value: UnsafeCell<T>,
}

impl<T: Kind> Guarded<T> {
    /// Makes an object of memory.
    ///
    /// # Safety
    /// The caller's promise, for `size_of::<Self>()` bytes at a multiple of the type's alignment.
    pub(crate) unsafe fn place(memory: *mut Self, value: T) {
        let head =
            Head { mark: AtomicU32::new(T::MARK), users: AtomicU32::new(0), own: AtomicUsize::new(memory.addr()) };
        // SAFETY: the promise of this function.
        unsafe { memory.write(Self { head, value: UnsafeCell::new(value) }) }
    }

    /// The live object at an address.
    ///
    /// # Safety
    /// The caller's promise. That the object is one is checked, as far as a mark and its own address go.
    pub(crate) unsafe fn at<'a>(object: *const Self) -> Result<&'a Self, Fault> {
        let object = checked(object, T::NAME)?;
        // SAFETY: the caller's promise; any bytes are a head, which is smaller than the object and in front.
        let head: &Head = unsafe { object.cast().as_ref() };
        let mark = head.mark.load(Ordering::Acquire);
        if mark == !T::MARK && head.own.load(Ordering::Relaxed) == object.addr().get() {
            return Err(Fault::new(CROUPIER_DESTROYED, T::NAME));
        }
        if mark != T::MARK || head.own.load(Ordering::Relaxed) != object.addr().get() {
            return Err(Fault::new(CROUPIER_NO_OBJECT, T::NAME));
        }
        // SAFETY: `place` has made an object here; mark and address together say so.
        Ok(unsafe { object.as_ref() })
    }

    /// Asked again by a call that has locked the object: another one may have ended it since [`Self::at`]. The lock orders
    /// this after that call's mark. A lock that is then dropped changes the head and not the value.
    fn still_live(&self) -> Result<(), Fault> {
        match self.head.mark.load(Ordering::Acquire) == T::MARK {
            true => Ok(()),
            false => Err(Fault::new(CROUPIER_DESTROYED, T::NAME)),
        }
    }

    /// The object to be read, by any number of calls at a time.
    pub(crate) fn read(&self) -> Result<Reading<'_, T>, Fault> {
        let users = &self.head.users;
        let mut now = users.load(Ordering::Relaxed);
        loop {
            let next = now.checked_add(1).filter(|n| *n != EXCLUSIVE);
            let next = next.ok_or(Fault::new(CROUPIER_BUSY, T::NAME))?;
            match users.compare_exchange_weak(now, next, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => {
                    let reading = Reading(self);
                    return self.still_live().map(|()| reading);
                }
                Err(other) => now = other,
            }
        }
    }

    /// The value of an object that is locked for reading.
    ///
    /// # Safety
    /// It is, as long as the value is used.
    pub(crate) unsafe fn locked(&self) -> &T {
        // SAFETY: the promise of this function.
        unsafe { &*self.value.get() }
    }

    /// The object for one call.
    pub(crate) fn write(&self) -> Result<Writing<'_, T>, Fault> {
        match self.head.users.compare_exchange(0, EXCLUSIVE, Ordering::Acquire, Ordering::Relaxed) {
            Ok(_) => {
                let writing = Writing(self);
                self.still_live().map(|()| writing)
            }
            Err(_) => Err(Fault::new(CROUPIER_BUSY, T::NAME)),
        }
    }
}

/// Shared use of an object.
pub(crate) struct Reading<'a, T>(&'a Guarded<T>);

impl<T> Deref for Reading<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: while this exists `users` counts it, so that no `Writing` does.
        unsafe { &*self.0.value.get() }
    }
}

impl<'a, T> Reading<'a, T> {
    /// A use that was forgotten, to be dropped.
    ///
    /// # Safety
    /// It was forgotten, and is not taken up twice.
    pub(crate) unsafe fn again(object: &'a Guarded<T>) -> Self {
        Self(object)
    }
}

impl<T> Drop for Reading<'_, T> {
    fn drop(&mut self) {
        self.0.head.users.fetch_sub(1, Ordering::Release);
    }
}

/// Exclusive use of an object.
pub(crate) struct Writing<'a, T>(&'a Guarded<T>);

impl<T: Kind> Writing<'_, T> {
    /// Marks the object as dead.
    pub(crate) fn bury(self) {
        self.0.head.mark.store(!T::MARK, Ordering::Release);
    }
}

impl<T> Deref for Writing<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: while this exists `users` is `EXCLUSIVE`, so that there is no other use.
        unsafe { &*self.0.value.get() }
    }
}

impl<T> DerefMut for Writing<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        // SAFETY: as in `deref`.
        unsafe { &mut *self.0.value.get() }
    }
}

impl<T> Drop for Writing<'_, T> {
    fn drop(&mut self) {
        self.0.head.users.store(0, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Number(#[expect(dead_code, reason = "what is guarded")] u64);

    impl Kind for Number {
        const MARK: u32 = 0x1234_5678;
        const NAME: &'static str = "number";
    }

    /// A call that found the object live and locks it after another call has ended it. Killed by: a mark that is looked
    /// at before the lock is taken, and not afterwards.
    #[test]
    fn what_ends_between_the_mark_and_the_lock_is_not_used() {
        let mut memory = core::mem::MaybeUninit::<Guarded<Number>>::uninit();
        // SAFETY: of the right size and alignment, and on this thread alone.
        unsafe { Guarded::place(memory.as_mut_ptr(), Number(5)) };
        // SAFETY: made above.
        let find = || unsafe { Guarded::at(memory.as_ptr()) };
        let found = [(); 3].map(|()| find().ok());
        let [Some(first), Some(reader), Some(writer)] = found else { panic!("a live object") };
        if let Ok(alone) = first.write() {
            alone.bury();
        }
        assert_eq!(reader.read().err().map(|e| e.status), Some(CROUPIER_DESTROYED));
        assert_eq!(writer.write().err().map(|e| e.status), Some(CROUPIER_DESTROYED));
        assert_eq!(first.head.users.load(Ordering::Relaxed), 0, "refused calls keep no lock");
        assert_eq!(find().err().map(|e| e.status), Some(CROUPIER_DESTROYED));
    }
}
