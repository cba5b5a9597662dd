//! Steam Audio (phonon), of version 4.8 or later: its direct effect (distance) and its binaural effect.

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};
use std::rc::Rc;

use super::{function, load};

/// The version whose structures are declared here: 4.8.0.
const VERSION: c_uint = (4 << 16) | (8 << 8);
const BANDS: usize = 3;
const SIMD_AVX2: c_int = 3;
const HRTF_SOFA: c_int = 1;
const APPLY_DISTANCE_ATTENUATION: c_int = 1;

#[repr(C)]
struct ContextSettings {
    version: c_uint,
    log: *const c_void,
    allocate: *const c_void,
    free: *const c_void,
    simd: c_int,
    flags: c_int,
}

#[repr(C)]
struct AudioSettings {
    rate_hz: c_int,
    frames: c_int,
}

#[repr(C)]
struct AudioBuffer {
    channels: c_int,
    frames: c_int,
    data: *mut *mut f32,
}

#[repr(C)]
struct HrtfSettings {
    kind: c_int,
    sofa_file: *const c_char,
    sofa_data: *const u8,
    sofa_size: c_int,
    volume: f32,
    normalisation: c_int,
}

#[repr(C)]
struct BinauralEffectSettings {
    hrtf: *mut c_void,
}

#[repr(C)]
struct BinauralEffectParameters {
    direction: [f32; 3],
    interpolation: c_int,
    spatial_blend: f32,
    hrtf: *mut c_void,
    peak_delays: *mut f32,
}

#[repr(C)]
struct DirectEffectSettings {
    channels: c_int,
}

#[repr(C)]
struct DirectEffectParameters {
    flags: c_int,
    transmission_type: c_int,
    distance_attenuation: f32,
    air_absorption: [f32; BANDS],
    directivity: f32,
    occlusion: f32,
    transmission: [f32; BANDS],
}

/// As a C compiler lays out the header's structures on 64-bit machines.
#[cfg(target_pointer_width = "64")]
const _: () = {
    assert!(size_of::<ContextSettings>() == 40 && size_of::<HrtfSettings>() == 40);
    assert!(size_of::<BinauralEffectParameters>() == 40 && size_of::<DirectEffectParameters>() == 44);
    assert!(std::mem::offset_of!(HrtfSettings, volume) == 28);
    assert!(std::mem::offset_of!(BinauralEffectParameters, hrtf) == 24);
    assert!(std::mem::offset_of!(DirectEffectParameters, transmission) == 32);
};

type Handle = *mut c_void;
type Create<S> = unsafe extern "C" fn(Handle, *mut AudioSettings, *mut S, *mut Handle) -> c_int;
type Apply<P> = unsafe extern "C" fn(Handle, *mut P, *mut AudioBuffer, *mut AudioBuffer) -> c_int;
type Release = unsafe extern "C" fn(*mut Handle);

struct Functions {
    create_context: unsafe extern "C" fn(*mut ContextSettings, *mut Handle) -> c_int,
    release_context: Release,
    create_hrtf: Create<HrtfSettings>,
    release_hrtf: Release,
    create_binaural: Create<BinauralEffectSettings>,
    apply_binaural: Apply<BinauralEffectParameters>,
    release_binaural: Release,
    create_direct: Create<DirectEffectSettings>,
    apply_direct: Apply<DirectEffectParameters>,
    release_direct: Release,
    mix: unsafe extern "C" fn(Handle, *mut AudioBuffer, *mut AudioBuffer),
}

/// How directions between those of a set are filled in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    Nearest = 0,
    Bilinear = 1,
}

/// The library with a head, ready to make voices for blocks of one length.
pub struct Phonon {
    functions: Functions,
    context: Handle,
    hrtf: Handle,
    rate_hz: u32,
    frames: usize,
}

impl Phonon {
    /// Loads a library and a SOFA file.
    ///
    /// # Errors
    /// Where either cannot be loaded.
    pub fn load(library: &str, sofa: &Path, rate_hz: u32, frames: usize) -> Result<Rc<Self>, String> {
        // SAFETY: The library is trusted to be Steam Audio; the types are those of its header.
        let functions = unsafe {
            let library = load(&[library]).ok_or_else(|| format!("{library} cannot be loaded"))?;
            Functions {
                create_context: function(library, "iplContextCreate")?,
                release_context: function(library, "iplContextRelease")?,
                create_hrtf: function(library, "iplHRTFCreate")?,
                release_hrtf: function(library, "iplHRTFRelease")?,
                create_binaural: function(library, "iplBinauralEffectCreate")?,
                apply_binaural: function(library, "iplBinauralEffectApply")?,
                release_binaural: function(library, "iplBinauralEffectRelease")?,
                create_direct: function(library, "iplDirectEffectCreate")?,
                apply_direct: function(library, "iplDirectEffectApply")?,
                release_direct: function(library, "iplDirectEffectRelease")?,
                mix: function(library, "iplAudioBufferMix")?,
            }
        };
        // Whatever has been made is released when this is dropped.
        let mut phonon = Self { functions, context: null_mut(), hrtf: null_mut(), rate_hz, frames };
        let mut settings = ContextSettings {
            version: VERSION,
            log: null(),
            allocate: null(),
            free: null(),
            simd: SIMD_AVX2,
            flags: 0,
        };
        // SAFETY: The settings are laid out as the version says, and callbacks may be null.
        let status = unsafe { (phonon.functions.create_context)(&mut settings, &mut phonon.context) };
        made(status, phonon.context, "a context")?;
        let file = sofa.to_str().and_then(|file| CString::new(file).ok()).ok_or("a file of no such name")?;
        let mut settings = HrtfSettings {
            kind: HRTF_SOFA,
            sofa_file: file.as_ptr(),
            sofa_data: null(),
            sofa_size: 0,
            volume: 1.0,
            normalisation: 0,
        };
        let mut audio = phonon.audio();
        // SAFETY: The file's name outlives the call.
        let status = unsafe {
            (phonon.functions.create_hrtf)(phonon.context, &mut audio, &mut settings, &mut phonon.hrtf)
        };
        made(status, phonon.hrtf, &format!("a head of {}", sofa.display()))?;
        Ok(Rc::new(phonon))
    }

    fn audio(&self) -> AudioSettings {
        AudioSettings { rate_hz: self.rate_hz as c_int, frames: self.frames as c_int }
    }

    /// Adds what a voice has rendered to a sum, by the library's own mixing.
    pub fn mix(&self, from: &mut Channels<2>, to: &mut Channels<2>) {
        // SAFETY: Both buffers have two channels of one block each.
        unsafe { (self.functions.mix)(self.context, &mut from.buffer(self), &mut to.buffer(self)) };
    }
}

/// Whether something was made.
fn made(status: c_int, handle: Handle, what: &str) -> Result<(), String> {
    if status == 0 && !handle.is_null() {
        Ok(())
    } else {
        Err(format!("it cannot make {what}: status {status}"))
    }
}

impl Drop for Phonon {
    fn drop(&mut self) {
        // SAFETY: Both were made by this and are released once, after all voices, which keep this.
        unsafe {
            if !self.hrtf.is_null() {
                (self.functions.release_hrtf)(&mut self.hrtf);
            }
            if !self.context.is_null() {
                (self.functions.release_context)(&mut self.context);
            }
        }
    }
}

/// Samples of a block, channel by channel.
pub struct Channels<const N: usize> {
    pub samples: [Vec<f32>; N],
    addresses: [*mut f32; N],
}

impl<const N: usize> Channels<N> {
    pub fn new(frames: usize) -> Self {
        Self { samples: std::array::from_fn(|_| vec![0.0; frames]), addresses: [null_mut(); N] }
    }

    /// What the library reads and writes, as long as this is borrowed.
    fn buffer(&mut self, phonon: &Phonon) -> AudioBuffer {
        for (address, samples) in self.addresses.iter_mut().zip(&mut self.samples) {
            samples.resize(phonon.frames, 0.0);
            *address = samples.as_mut_ptr();
        }
        let frames = phonon.frames as c_int;
        AudioBuffer { channels: N as c_int, frames, data: self.addresses.as_mut_ptr() }
    }
}

/// The effects of one voice.
pub struct Effects {
    phonon: Rc<Phonon>,
    direct: Handle,
    binaural: Handle,
}

impl Effects {
    /// # Errors
    /// Where the library makes none.
    pub fn new(phonon: &Rc<Phonon>) -> Result<Self, String> {
        let mut effects = Self { phonon: phonon.clone(), direct: null_mut(), binaural: null_mut() };
        let (functions, mut audio) = (&phonon.functions, phonon.audio());
        let mut settings = DirectEffectSettings { channels: 1 };
        // SAFETY: The settings are read during the call alone.
        let status = unsafe {
            (functions.create_direct)(phonon.context, &mut audio, &mut settings, &mut effects.direct)
        };
        made(status, effects.direct, "a direct effect")?;
        let mut settings = BinauralEffectSettings { hrtf: phonon.hrtf };
        // SAFETY: As before; the head lives as long as `phonon`.
        let status = unsafe {
            (functions.create_binaural)(phonon.context, &mut audio, &mut settings, &mut effects.binaural)
        };
        made(status, effects.binaural, "a binaural effect")?;
        Ok(effects)
    }

    /// What two ears hear of a block of one channel, from a direction of length 1 and by a gain. `from` is left with
    /// the gain applied.
    pub fn apply(
        &self,
        direction: [f32; 3],
        gain: f32,
        interpolation: Interpolation,
        from: &mut Channels<1>,
        to: &mut Channels<2>,
    ) {
        let (phonon, functions) = (&self.phonon, &self.phonon.functions);
        let mut distance = DirectEffectParameters {
            flags: APPLY_DISTANCE_ATTENUATION,
            transmission_type: 0,
            distance_attenuation: gain,
            air_absorption: [1.0; BANDS],
            directivity: 1.0,
            occlusion: 1.0,
            transmission: [1.0; BANDS],
        };
        let mut binaural = BinauralEffectParameters {
            direction,
            interpolation: interpolation as c_int,
            spatial_blend: 1.0,
            hrtf: phonon.hrtf,
            peak_delays: null_mut(),
        };
        // SAFETY: The direct effect may work in place, by the header; the buffers have the channels the effects were
        // made for and one block of frames each. Peak delays may be null.
        unsafe {
            (functions.apply_direct)(
                self.direct,
                &mut distance,
                &mut from.buffer(phonon),
                &mut from.buffer(phonon),
            );
            (functions.apply_binaural)(
                self.binaural,
                &mut binaural,
                &mut from.buffer(phonon),
                &mut to.buffer(phonon),
            );
        }
    }
}

impl Drop for Effects {
    fn drop(&mut self) {
        // SAFETY: Both were made by this and are released once.
        unsafe {
            if !self.direct.is_null() {
                (self.phonon.functions.release_direct)(&mut self.direct);
            }
            if !self.binaural.is_null() {
                (self.phonon.functions.release_binaural)(&mut self.binaural);
            }
        }
    }
}
