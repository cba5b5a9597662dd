//! The device: which there are, what they can do, and a stream that plays from a deck.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};

use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{BufferSize, FromSample, I24, SampleFormat, SizedSample, StreamConfig};
use froufrou::render::live::deck::Deck;
use froufrou::{Error, Result};

const NONE_HELP: &str = "connect one, or start a sound server such as PipeWire or PulseAudio; \
                         `froufrou render` writes files without any";

/// Samples that are converted at once.
const ROOM: usize = 8192;

/// A device that can be played to, or looked for again.
pub struct Output {
    name: Option<String>,
    device: cpal::Device,
    config: StreamConfig,
    format: SampleFormat,
    block_frames: u32,
}

/// What a device asks for block after block.
pub trait Fill: Send + 'static {
    /// Fills a block with interleaved frames.
    fn fill(&mut self, block: &mut [f32]);
}

impl Fill for Deck {
    fn fill(&mut self, block: &mut [f32]) {
        Deck::fill(self, block);
    }
}

/// A device that plays. It lets go of the deck when it is dropped, or when it cannot begin.
pub struct Playing {
    _stream: cpal::Stream,
    is_lost: Arc<AtomicBool>,
    hiccups: Arc<AtomicU64>,
    granted: Arc<AtomicU8>,
}

/// Where what is played, a deck, comes back to from a stream.
pub struct Home<D> {
    sender: Sender<D>,
    receiver: Receiver<D>,
}

impl<D> Home<D> {
    pub fn new() -> Self {
        let (sender, receiver) = channel();
        Self { sender, receiver }
    }

    /// The deck, once no stream has it.
    pub fn take(&self) -> Option<D> {
        self.receiver.recv_timeout(std::time::Duration::from_secs(5)).ok()
    }
}

/// A deck that goes home when it is dropped.
struct Lent<D> {
    deck: Option<D>,
    home: Sender<D>,
    urgency: Urgency,
}

impl<D: Fill> Lent<D> {
    fn fill(&mut self, block: &mut [f32]) {
        self.urgency.ask();
        match &mut self.deck {
            Some(deck) => deck.fill(block),
            None => block.fill(0.0),
        }
    }
}

impl<D> Drop for Lent<D> {
    fn drop(&mut self) {
        if let Some(deck) = self.deck.take() {
            // Nobody waits for it where all is over.
            let _ = self.home.send(deck);
        }
    }
}

/// ALSA writes to standard error whatever devices of its configuration are not there, asked for or not. What matters comes as
/// a fault. From now on the library keeps it for this thread, until this is called again.
#[cfg(target_os = "linux")]
fn hush() {
    // Where it cannot be, it is as loud as before.
    let _ = alsa::Output::local_error_handler();
}

#[cfg(not(target_os = "linux"))]
fn hush() {}

/// All devices for output, by host.
fn devices() -> Vec<(String, cpal::Device)> {
    hush();
    let hosts = cpal::available_hosts().into_iter().filter_map(|id| cpal::host_from_id(id).ok());
    let mut found = Vec::new();
    for host in hosts {
        for device in host.output_devices().into_iter().flatten() {
            found.push((name_of(&device), device));
        }
    }
    found
}

fn name_of(device: &cpal::Device) -> String {
    let shown = device.description().map(|description| description.to_string());
    match (device.id(), shown) {
        (Ok(id), Ok(shown)) => format!("{id}: {shown}"),
        (Ok(id), Err(_)) => id.to_string(),
        (Err(_), Ok(shown)) => shown,
        (Err(_), Err(_)) => "a device without a name".to_owned(),
    }
}

/// The names of all devices.
pub fn names() -> Vec<String> {
    devices().into_iter().map(|(name, _)| name).collect()
}

/// The device that is asked for by a part of its name, or the one that the system prefers.
fn find(name: Option<&str>) -> Result<cpal::Device> {
    hush();
    let none = || Error::new("this machine has no device to play to").help(NONE_HELP);
    let Some(name) = name else {
        let hosts = cpal::available_hosts().into_iter().filter_map(|id| cpal::host_from_id(id).ok());
        return hosts.into_iter().find_map(|host| host.default_output_device()).ok_or_else(none);
    };
    let mut all = devices();
    let wanted = name.to_lowercase();
    if let Some(at) = all.iter().position(|(name, _)| name.to_lowercase().contains(&wanted)) {
        return Ok(all.swap_remove(at).1);
    }
    match all.as_slice() {
        [] => Err(none()),
        all => {
            let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
            Err(Error::new(format!("no device is called `{name}`"))
                .help(format!("there are {}", names.join("; "))))
        }
    }
}

impl Output {
    /// Finds a device that has so many channels; at a rate, or else the one it prefers.
    ///
    /// # Errors
    /// No such device, or none that can play this.
    pub fn find(name: Option<String>, channels: usize, rate_hz: u32, block_frames: u32) -> Result<Self> {
        let device = find(name.as_deref())?;
        let shown = name_of(&device);
        let fault = |fault: cpal::Error| Error::new(format!("{shown}: {fault}")).help(NONE_HELP);
        let preferred_hz = device.default_output_config().map(|config| config.sample_rate()).ok();
        let all: Vec<_> = device.supported_output_configs().map_err(fault)?.collect();
        let fits: Vec<_> = all.iter().filter(|config| usize::from(config.channels()) == channels).collect();
        let rates = [Some(rate_hz), preferred_hz].into_iter().flatten();
        let at = |rate_hz: u32| {
            let mut there: Vec<SampleFormat> = fits
                .iter()
                .filter(|config| (config.min_sample_rate()..=config.max_sample_rate()).contains(&rate_hz))
                .map(|config| config.sample_format())
                .filter(|format| is_known(*format))
                .collect();
            there.sort_by_key(|format| *format != SampleFormat::F32);
            there.first().map(|format| (rate_hz, *format))
        };
        let Some((rate_hz, format)) = rates.into_iter().find_map(at) else {
            let most = all.iter().map(|config| config.channels()).max().unwrap_or(0);
            let what =
                format!("{shown} cannot play {channels} channels at {rate_hz} Hz; it has {most} at most");
            return Err(Error::new(what).help("try another `--layout`, `--rate` or `--device`"));
        };
        let buffer_size = BufferSize::Fixed(block_frames);
        let config = StreamConfig { channels: channels as u16, sample_rate: rate_hz, buffer_size };
        Ok(Self { name, device, config, format, block_frames })
    }

    /// The rate at which it plays.
    pub fn rate_hz(&self) -> u32 {
        self.config.sample_rate
    }

    /// Its name.
    pub fn name(&self) -> String {
        name_of(&self.device)
    }

    /// Looks for it again, after it was lost.
    ///
    /// # Errors
    /// As [`Output::find`]; or where it has another rate now.
    pub fn find_again(&mut self) -> Result<()> {
        let channels = usize::from(self.config.channels);
        let found = Self::find(self.name.clone(), channels, self.rate_hz(), self.block_frames)?;
        if found.rate_hz() != self.rate_hz() {
            return Err(Error::new(format!("it plays at {} Hz now", found.rate_hz())));
        }
        *self = found;
        Ok(())
    }

    /// Lets it play a deck. Where it cannot, the deck is at home again.
    ///
    /// # Errors
    /// What the device says.
    pub fn play<D: Fill>(&self, deck: D, home: &Home<D>) -> Result<Playing> {
        let urgency = Urgency::default();
        let granted = urgency.granted.clone();
        let lent = Lent { deck: Some(deck), home: home.sender.clone(), urgency };
        let is_lost = Arc::new(AtomicBool::new(false));
        let lost = is_lost.clone();
        let hiccups = Arc::new(AtomicU64::new(0));
        let counted = hiccups.clone();
        // A sound server may tell of the same fault many times.
        let on_fault = move |fault: cpal::Error| {
            use cpal::ErrorKind::{DeviceBusy, DeviceChanged, RealtimeDenied, Xrun};
            if matches!(fault.kind(), Xrun) {
                counted.fetch_add(1, Relaxed);
            }
            if !matches!(fault.kind(), DeviceBusy | DeviceChanged | RealtimeDenied | Xrun) {
                lost.store(true, Relaxed);
            }
        };
        let stream = match self.format {
            SampleFormat::F32 => self.stream_f32(lent, on_fault),
            SampleFormat::F64 => self.stream::<f64, D>(lent, on_fault),
            SampleFormat::I16 => self.stream::<i16, D>(lent, on_fault),
            SampleFormat::I24 => self.stream::<I24, D>(lent, on_fault),
            SampleFormat::I32 => self.stream::<i32, D>(lent, on_fault),
            SampleFormat::U16 => self.stream::<u16, D>(lent, on_fault),
            _ => self.stream::<u8, D>(lent, on_fault),
        };
        let said = |fault: cpal::Error| Error::new(format!("{}: {fault}", self.name()));
        let stream = stream.map_err(said)?;
        stream.play().map_err(said)?;
        Ok(Playing { _stream: stream, is_lost, hiccups, granted })
    }

    fn stream_f32<D: Fill>(
        &self,
        mut lent: Lent<D>,
        on_fault: impl FnMut(cpal::Error) + Send + 'static,
    ) -> std::result::Result<cpal::Stream, cpal::Error> {
        let fill = move |block: &mut [f32], _: &cpal::OutputCallbackInfo| lent.fill(block);
        self.device.build_output_stream(self.config, fill, on_fault, None)
    }

    fn stream<T: SizedSample + FromSample<f32>, D: Fill>(
        &self,
        mut lent: Lent<D>,
        on_fault: impl FnMut(cpal::Error) + Send + 'static,
    ) -> std::result::Result<cpal::Stream, cpal::Error> {
        let channels = usize::from(self.config.channels);
        let mut room = vec![0.0f32; ROOM / channels * channels];
        let fill = move |block: &mut [T], _: &cpal::OutputCallbackInfo| {
            for part in block.chunks_mut(room.len()) {
                let room = &mut room[..part.len()];
                lent.fill(room);
                for (to, sample) in part.iter_mut().zip(room) {
                    *to = T::from_sample(*sample);
                }
            }
        };
        self.device.build_output_stream(self.config, fill, on_fault, None)
    }
}

impl Playing {
    /// Whether the device has gone, or does not play any more.
    pub fn is_lost(&self) -> bool {
        self.is_lost.load(Relaxed)
    }

    /// Whether the system lets the audio thread go before others; `None`: it has not been asked yet.
    pub fn is_urgent(&self) -> Option<bool> {
        match self.granted.load(Relaxed) {
            UNASKED => None,
            granted => Some(granted == GRANTED),
        }
    }

    /// How often the device says that it had nothing to play in time.
    pub fn hiccups(&self) -> u64 {
        self.hiccups.load(Relaxed)
    }
}

/// Asks the system, once and on the audio thread itself, to let that go before others.
#[derive(Default)]
struct Urgency {
    is_asked: bool,
    granted: Arc<AtomicU8>,
}

const UNASKED: u8 = 0;
const GRANTED: u8 = 1;
const DENIED: u8 = 2;

impl Urgency {
    fn ask(&mut self) {
        if !std::mem::replace(&mut self.is_asked, true) {
            self.granted.store(if go_first() { GRANTED } else { DENIED }, Relaxed);
        }
    }
}

/// Lets this thread go before others, if the system allows it.
#[cfg(target_os = "linux")]
fn go_first() -> bool {
    use thread_priority::unix::{
        RealtimeThreadSchedulePolicy::RoundRobin, ThreadSchedulePolicy::Realtime,
        set_thread_priority_and_policy, thread_native_id,
    };
    use thread_priority::{ThreadPriority, ThreadPriorityValue};
    // Before all that is not real time, and behind what serves devices.
    let Ok(priority) = ThreadPriorityValue::try_from(URGENCY) else { return false };
    let priority = ThreadPriority::Crossplatform(priority);
    set_thread_priority_and_policy(thread_native_id(), priority, Realtime(RoundRobin)).is_ok()
}

/// As sound servers ask for their clients.
#[cfg(target_os = "linux")]
const URGENCY: u8 = 10;

/// Elsewhere the system sees to that itself.
#[cfg(not(target_os = "linux"))]
fn go_first() -> bool {
    true
}

fn is_known(format: SampleFormat) -> bool {
    use SampleFormat::{F32, F64, I16, I24, I32, U8, U16};
    matches!(format, F32 | F64 | I16 | I24 | I32 | U16 | U8)
}
