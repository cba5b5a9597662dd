//! What cloth sounds like (An, James & Marschner 2012): spectra of its friction over speed and the pops of its
//! crumpling, from recordings or from models. Nothing here knows of meshes.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`spectra`] | the spectrum of friction at any speed, between those that were measured |
//! | [`clips`] | measures them in recordings whose speed is known by a [`motion`] |
//! | [`pops`] | cuts pops out of recordings |
//! | [`playback`] | chooses a pop for each buckling of an animation |

pub mod clips;
pub mod motion;
pub mod playback;
pub mod pops;
pub mod spectra;
