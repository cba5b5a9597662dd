//! The game loop of the README is a program that runs.

#[test]
fn the_readme_shows_it_and_it_is_short() {
    let text = include_str!("../examples/game.rs");
    assert!(include_str!("../../../README.md").contains(&format!("```rust\n{text}```")));
    assert!(text.lines().count() <= 50, "{}", text.lines().count());
}

/// The program, with a device of our own in place of cpal's.
#[cfg(not(feature = "device"))]
mod headless {
    mod cpal {
        use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
        use std::sync::{Arc, Mutex};
        use std::time::Duration;

        /// The frames that all devices have played, and how many samples of them were heard.
        pub static PLAYED: AtomicU64 = AtomicU64::new(0);
        pub static LOUD: AtomicU64 = AtomicU64::new(0);

        #[allow(dead_code)] // They are asked for by name alone.
        pub mod traits {
            pub trait HostTrait {}
            pub trait DeviceTrait {}
            pub trait StreamTrait {}
        }

        pub struct Host;
        pub struct Device;
        pub struct OutputCallbackInfo;
        pub struct Stream {
            begins: Mutex<Option<Box<dyn FnOnce() + Send>>>,
            ends: Arc<AtomicBool>,
        }

        pub enum BufferSize {
            Fixed(u32),
        }

        pub struct StreamConfig {
            pub channels: u16,
            pub sample_rate: u32,
            pub buffer_size: BufferSize,
        }

        pub fn default_host() -> Host {
            Host
        }

        impl Host {
            pub fn default_output_device(&self) -> Option<Device> {
                Some(Device)
            }
        }

        impl Device {
            pub fn build_output_stream(
                &self,
                config: StreamConfig,
                mut fill: impl FnMut(&mut [f32], &OutputCallbackInfo) + Send + 'static,
                _fault: impl FnMut(String) + Send + 'static,
                _timeout: Option<Duration>,
            ) -> Result<Stream, String> {
                let BufferSize::Fixed(frames) = config.buffer_size;
                let pause = Duration::from_secs_f64(f64::from(frames) / f64::from(config.sample_rate));
                let mut block = vec![0.0; frames as usize * usize::from(config.channels)];
                let ends = Arc::new(AtomicBool::new(false));
                let ended = ends.clone();
                let play = move || {
                    while !ended.load(Relaxed) {
                        fill(&mut block, &OutputCallbackInfo);
                        PLAYED.fetch_add(u64::from(frames), Relaxed);
                        LOUD.fetch_add(block.iter().filter(|s| s.abs() > 0.001).count() as u64, Relaxed);
                        std::thread::sleep(pause);
                    }
                };
                Ok(Stream { begins: Mutex::new(Some(Box::new(play))), ends })
            }
        }

        impl Stream {
            pub fn play(&self) -> Result<(), String> {
                let begins = self.begins.lock().map_err(|fault| fault.to_string())?.take();
                std::thread::spawn(begins.ok_or("it plays already")?);
                Ok(())
            }
        }

        impl Drop for Stream {
            fn drop(&mut self) {
                self.ends.store(true, Relaxed);
            }
        }
    }

    mod game {
        #[allow(unused_imports)] // The traits of our device have nothing in them.
        mod program {
            use super::super::cpal;
            include!("../examples/game.rs");

            pub fn run() -> Result<(), Box<dyn std::error::Error>> {
                main()
            }
        }
        pub use program::run;
    }

    #[test]
    fn it_runs_and_is_heard() {
        game::run().expect("a game");
        let (played, loud) = (
            cpal::PLAYED.load(std::sync::atomic::Ordering::Relaxed),
            cpal::LOUD.load(std::sync::atomic::Ordering::Relaxed),
        );
        assert!(played > 48_000, "{played} frames");
        assert!(loud > 1_000, "{loud} samples are heard");
    }
}
