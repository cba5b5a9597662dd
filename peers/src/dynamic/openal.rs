//! OpenAL Soft, of version 1.19 or later, through `ALC_SOFT_loopback`: it renders where and when it is asked, without a device.
//!
//! OpenAL Soft is under the LGPL. It is loaded to be measured, and neither linked nor shipped.

use std::ffi::{CStr, c_char, c_float, c_int, c_uint, c_void};
use std::ptr::null_mut;
use std::rc::Rc;

use super::{function, load};

const LIBRARIES: &[&str] = &["libopenal.so.1", "libopenal.1.dylib", "soft_oal.dll", "OpenAL32.dll"];

const ALC_FREQUENCY: c_int = 0x1007;
const ALC_MONO_SOURCES: c_int = 0x1010;
const ALC_FORMAT_CHANNELS: c_int = 0x1990;
const ALC_FORMAT_TYPE: c_int = 0x1991;
const ALC_STEREO: c_int = 0x1501;
const ALC_FLOAT: c_int = 0x1406;
const ALC_HRTF: c_int = 0x1992;
const ALC_HRTF_STATUS: c_int = 0x1993;
const ALC_HRTF_SPECIFIER: c_int = 0x1995;
const ALC_OUTPUT_LIMITER: c_int = 0x199A;
/// The values of `ALC_HRTF_STATUS` with which a head is heard: enabled, required, headphones detected.
const HRTF_IS_ON: [c_int; 3] = [1, 3, 4];

const AL_POSITION: c_int = 0x1004;
const AL_VELOCITY: c_int = 0x1006;
const AL_LOOPING: c_int = 0x1007;
const AL_BUFFER: c_int = 0x1009;
const AL_SOURCE_STATE: c_int = 0x1010;
const AL_PLAYING: c_int = 0x1012;
const AL_SAMPLE_OFFSET: c_int = 0x1025;
const AL_FORMAT_MONO_FLOAT32: c_int = 0x10010;
const AL_NUM_RESAMPLERS: c_int = 0x1210;
const AL_DEFAULT_RESAMPLER: c_int = 0x1211;
const AL_SOURCE_RESAMPLER: c_int = 0x1212;
const AL_RESAMPLER_NAME: c_int = 0x1213;
const AL_VERSION: c_int = 0xB002;

/// Declares the functions that are called, and takes them out of the library by their names.
macro_rules! functions {
    ($($name:ident: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        #[allow(non_snake_case)]
        struct Functions { $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)* }

        impl Functions {
            fn load() -> Result<Self, String> {
                // SAFETY: The library is trusted to be OpenAL; the types are those of its headers.
                unsafe {
                    let library = load(LIBRARIES).ok_or("OpenAL Soft is not installed: apt install libopenal1")?;
                    Ok(Self { $($name: function(library, stringify!($name))?,)* })
                }
            }
        }
    };
}

functions! {
    alcLoopbackOpenDeviceSOFT: fn(*const c_char) -> *mut c_void;
    alcRenderSamplesSOFT: fn(*mut c_void, *mut c_void, c_int);
    alcCreateContext: fn(*mut c_void, *const c_int) -> *mut c_void;
    alcMakeContextCurrent: fn(*mut c_void) -> c_char;
    alcDestroyContext: fn(*mut c_void);
    alcCloseDevice: fn(*mut c_void) -> c_char;
    alcGetIntegerv: fn(*mut c_void, c_int, c_int, *mut c_int);
    alcGetString: fn(*mut c_void, c_int) -> *const c_char;
    alGetError: fn() -> c_int;
    alGetString: fn(c_int) -> *const c_char;
    alGetStringiSOFT: fn(c_int, c_int) -> *const c_char;
    alGetInteger: fn(c_int) -> c_int;
    alSpeedOfSound: fn(c_float);
    alGenBuffers: fn(c_int, *mut c_uint);
    alBufferData: fn(c_uint, c_int, *const c_void, c_int, c_int);
    alGenSources: fn(c_int, *mut c_uint);
    alSourcei: fn(c_uint, c_int, c_int);
    alSource3f: fn(c_uint, c_int, c_float, c_float, c_float);
    alGetSourcei: fn(c_uint, c_int, *mut c_int);
    alSourcePlayv: fn(c_int, *const c_uint);
    alDeferUpdatesSOFT: fn();
    alProcessUpdatesSOFT: fn();
}

/// The library.
#[derive(Clone)]
pub struct OpenAl(Rc<Functions>);

impl OpenAl {
    /// # Errors
    /// Where it is not installed, or lacks a function.
    pub fn load() -> Result<Self, String> {
        Functions::load().map(|functions| Self(Rc::new(functions)))
    }

    /// A device of its own that renders two float channels for a head, with room for so many voices.
    ///
    /// # Errors
    /// Where it does not, or does not use an HRTF.
    pub fn open(&self, rate_hz: u32, voices: usize) -> Result<Device, String> {
        let al = &self.0;
        let attributes = [
            [ALC_FREQUENCY, rate_hz as c_int],
            [ALC_FORMAT_CHANNELS, ALC_STEREO],
            [ALC_FORMAT_TYPE, ALC_FLOAT],
            [ALC_HRTF, 1],
            [ALC_OUTPUT_LIMITER, 0],
            [ALC_MONO_SOURCES, voices as c_int],
            [0, 0],
        ];
        // SAFETY: `Device` is made at once, and closes whatever has been opened. The attributes end with a zero, and
        // an integer is one `c_int`.
        let status = unsafe {
            let device = (al.alcLoopbackOpenDeviceSOFT)(std::ptr::null());
            if device.is_null() {
                return Err("it opens no loopback device".into());
            }
            let context = (al.alcCreateContext)(device, attributes.as_ptr().cast());
            let opened = Device { al: self.clone(), device, context };
            if context.is_null() {
                return Err(format!("it makes no context for {rate_hz} Hz and {voices} voices"));
            }
            opened.make_current();
            let mut status = 0;
            (al.alcGetIntegerv)(device, ALC_HRTF_STATUS, 1, &mut status);
            (opened, status)
        };
        let (device, status) = status;
        if !HRTF_IS_ON.contains(&status) {
            return Err(format!("its HRTF is off (status {status})"));
        }
        device.check("opening a device")?;
        Ok(device)
    }
}

/// A device that renders when it is asked, with its only context.
pub struct Device {
    al: OpenAl,
    device: *mut c_void,
    context: *mut c_void,
}

impl Device {
    /// Lets what follows be about this device. All others do it for themselves.
    fn make_current(&self) {
        // SAFETY: The context lives as long as this.
        unsafe { (self.al.0.alcMakeContextCurrent)(self.context) };
    }

    fn check(&self, what: &str) -> Result<(), String> {
        // SAFETY: It has no arguments.
        match unsafe { (self.al.0.alGetError)() } {
            0 => Ok(()),
            error => Err(format!("{what} failed with error {error:#x}")),
        }
    }

    /// # Safety
    /// `text` must be null or a C string that stays.
    unsafe fn text(text: *const c_char) -> String {
        if text.is_null() {
            return "unknown".into();
        }
        unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
    }

    /// The version of the library and the name of the head.
    pub fn names(&self) -> [String; 2] {
        self.make_current();
        // SAFETY: OpenAL keeps its strings as long as the device.
        unsafe {
            [
                Self::text((self.al.0.alGetString)(AL_VERSION)),
                Self::text((self.al.0.alcGetString)(self.device, ALC_HRTF_SPECIFIER)),
            ]
        }
    }

    /// The names of the resamplers, and which of them is the default.
    pub fn resamplers(&self) -> (Vec<String>, usize) {
        self.make_current();
        let al = &self.al.0;
        // SAFETY: OpenAL keeps its strings as long as the device.
        unsafe {
            let count = (al.alGetInteger)(AL_NUM_RESAMPLERS).max(0);
            let name = |index| Self::text((al.alGetStringiSOFT)(AL_RESAMPLER_NAME, index));
            ((0..count).map(name).collect(), (al.alGetInteger)(AL_DEFAULT_RESAMPLER).max(0) as usize)
        }
    }

    pub fn set_speed_of_sound(&self, metres_per_s: f32) {
        self.make_current();
        // SAFETY: It has no pointers.
        unsafe { (self.al.0.alSpeedOfSound)(metres_per_s) };
    }

    /// A mono recording; its number.
    ///
    /// # Errors
    /// Where it cannot be kept.
    pub fn add_sound(&self, samples: &[f32], rate_hz: u32) -> Result<u32, String> {
        self.make_current();
        let (al, mut buffer) = (&self.al.0, 0);
        // SAFETY: The samples are copied, as many bytes as the slice has.
        unsafe {
            (al.alGenBuffers)(1, &mut buffer);
            let bytes = size_of_val(samples) as c_int;
            let rate_hz = rate_hz as c_int;
            (al.alBufferData)(buffer, AL_FORMAT_MONO_FLOAT32, samples.as_ptr().cast(), bytes, rate_hz);
        }
        self.check("adding a sound")?;
        Ok(buffer)
    }

    /// A voice that repeats a sound from a frame of it on; its number.
    ///
    /// # Errors
    /// Where there is no room for it, or no such sound or resampler.
    pub fn add_voice(&self, sound: u32, offset: usize, resampler: usize) -> Result<u32, String> {
        self.make_current();
        let (al, mut source) = (&self.al.0, 0);
        // SAFETY: One number is asked for and one is there.
        unsafe {
            (al.alGenSources)(1, &mut source);
            (al.alSourcei)(source, AL_BUFFER, sound as c_int);
            (al.alSourcei)(source, AL_LOOPING, 1);
            (al.alSourcei)(source, AL_SOURCE_RESAMPLER, resampler as c_int);
            (al.alSourcei)(source, AL_SAMPLE_OFFSET, offset as c_int);
        }
        self.check("adding a voice")?;
        Ok(source)
    }

    /// # Errors
    /// Where one of them does not play then.
    pub fn play(&self, voices: &[u32]) -> Result<(), String> {
        self.make_current();
        let al = &self.al.0;
        // SAFETY: There are as many numbers as is said.
        unsafe { (al.alSourcePlayv)(voices.len() as c_int, voices.as_ptr()) };
        self.check("playing")?;
        let plays = |&&voice: &&u32| {
            let mut state = 0;
            // SAFETY: The state is one `c_int`.
            unsafe { (al.alGetSourcei)(voice, AL_SOURCE_STATE, &mut state) };
            state == AL_PLAYING
        };
        match voices.iter().filter(plays).count() {
            playing if playing == voices.len() => Ok(()),
            playing => Err(format!("{playing} of {} voices play", voices.len())),
        }
    }

    /// Moves voices all at once: where they are and how fast they move.
    pub fn place(&self, voices: impl Iterator<Item = (u32, [f32; 3], [f32; 3])>) {
        self.make_current();
        let al = &self.al.0;
        // SAFETY: None has pointers. A number that no voice has is refused by OpenAL.
        unsafe {
            (al.alDeferUpdatesSOFT)();
            for (voice, [x, y, z], [u, v, w]) in voices {
                (al.alSource3f)(voice, AL_POSITION, x, y, z);
                (al.alSource3f)(voice, AL_VELOCITY, u, v, w);
            }
            (al.alProcessUpdatesSOFT)();
        }
    }

    /// Renders the next frames.
    pub fn render(&self, frames: &mut [[f32; 2]]) {
        let count = frames.len() as c_int;
        // SAFETY: The device was opened for two float channels, which is what a frame is.
        unsafe { (self.al.0.alcRenderSamplesSOFT)(self.device, frames.as_mut_ptr().cast(), count) };
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let al = &self.al.0;
        // SAFETY: Both were opened by this and are closed once; a context must not be current then. Sounds and voices
        // go with them.
        unsafe {
            (al.alcMakeContextCurrent)(null_mut());
            if !self.context.is_null() {
                (al.alcDestroyContext)(self.context);
            }
            (al.alcCloseDevice)(self.device);
        }
    }
}
