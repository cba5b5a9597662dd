//! Recordings by what people call them.

use std::path::Path;

use crate::error::{Error, Result};

/// The number of the one that is called so: by its name, the end of it, or what no other has in its name.
///
/// ```
/// use froufrou::corpus::naming::find;
/// let names = ["hits/door.wav", "hits/door_2.wav", "slides/chair.wav"];
/// assert_eq!(find(&names, "door.wav")?, 0);
/// assert_eq!(find(&names, "chair")?, 2);
/// assert!(find(&names, "door").is_err() && find(&names, "window").is_err());
/// # Ok::<(), froufrou::Error>(())
/// ```
///
/// # Errors
/// Where none or several are called so.
pub fn find(names: &[impl AsRef<str>], wanted: &str) -> Result<usize> {
    let named = |test: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..names.len()).filter(|&number| test(names[number].as_ref())).collect()
    };
    let exact = named(&|name| name == wanted);
    let ends = || named(&|name| Path::new(name).ends_with(wanted));
    let within = || named(&|name| name.to_lowercase().contains(&wanted.to_lowercase()));
    let found = [exact, ends(), within()].into_iter().find(|found| !found.is_empty()).unwrap_or_default();
    match *found.as_slice() {
        [one] => Ok(one),
        [] => {
            let first: Vec<&str> = names.iter().map(AsRef::as_ref).take(8).collect();
            let more = if names.len() > first.len() { ", …" } else { "" };
            Err(Error::new(format!("the corpus has no recording `{wanted}`"))
                .help(format!("it has {}{more}", first.join(", "))))
        }
        [a, b, ..] => Err(Error::new(format!(
            "`{wanted}` is in the names of {} recordings, such as {} and {}",
            found.len(),
            names[a].as_ref(),
            names[b].as_ref()
        ))),
    }
}
