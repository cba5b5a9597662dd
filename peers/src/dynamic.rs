//! The only unsafe code: C libraries that are loaded while the program runs, if they are there.
//!
//! Nothing of them is needed to build. Each module declares by hand the few functions and structures it calls,
//! as the headers of the versions it names lay them out, and shows something safe: handles that free themselves
//! and keep alive what they need, and slices whose lengths are checked here.

pub mod openal;
pub mod phonon;

use libloading::Library;

/// The first of some libraries that can be loaded. It stays until the program ends, so that functions taken out
/// of it may be kept anywhere.
///
/// # Safety
/// What a library does when it is loaded is trusted.
unsafe fn load(names: &[&str]) -> Option<&'static Library> {
    let library = names.iter().find_map(|name| unsafe { Library::new(*name) }.ok())?;
    Some(Box::leak(Box::new(library)))
}

/// A function of a library.
///
/// # Safety
/// `F` must be the type that the library gives the function of that name.
unsafe fn function<F: Copy>(library: &'static Library, name: &str) -> Result<F, String> {
    match unsafe { library.get::<F>(name) } {
        Ok(function) => Ok(*function),
        Err(error) => Err(format!("{name}: {error}")),
    }
}
