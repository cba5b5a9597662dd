//! Whether the checks hold for what is here, and fail for what is wrong.

use crate::checks::{Heard, listen};
use crate::peers::kira::Kira;
use crate::peers::oddio::Oddio;
use crate::peers::{Kind, Peer, Rendering, Result, all};
use crate::world::World;

const VOICES: usize = 20;
const BLOCK: usize = 1024;

fn hear(peer: &dyn Peer) -> Heard {
    listen(peer, VOICES, BLOCK).expect("sound")
}

/// Those that no file and no library is needed for; OpenAL Soft where it is installed.
#[test]
fn peers_render_what_they_are_said_to() {
    let (peers, absent) = all(None);
    for why in absent {
        eprintln!("skipped: {why}");
    }
    assert!(peers.len() >= 4, "two rows of froufrou, oddio and kira");
    for peer in peers {
        assert_eq!(hear(&*peer).faults(peer.kind()), [""; 0], "{}", peer.name());
    }
}

/// A peer with something done to it.
struct Altered<P> {
    peer: P,
    /// Does something to the world before the peer sees it, and to each frame that it renders.
    world: fn(World) -> World,
    frame: fn([f32; 2]) -> [f32; 2],
}

struct AlteredRendering(Box<dyn Rendering>, fn([f32; 2]) -> [f32; 2]);

impl<P: Peer> Peer for Altered<P> {
    fn name(&self) -> String {
        "altered".into()
    }

    fn details(&self) -> String {
        String::new()
    }

    fn kind(&self) -> Kind {
        self.peer.kind()
    }

    fn start(&self, world: &World) -> Result<Box<dyn Rendering>> {
        Ok(Box::new(AlteredRendering(self.peer.start(&(self.world)(world.clone()))?, self.frame)))
    }
}

impl Rendering for AlteredRendering {
    fn tick(&mut self, time_s: f64) -> Result<()> {
        self.0.tick(time_s)
    }

    fn render(&mut self, block: &mut [[f32; 2]]) -> Result<()> {
        self.0.render(block)?;
        for frame in block {
            *frame = (self.1)(*frame);
        }
        Ok(())
    }
}

#[test]
fn a_lost_voice_is_noticed() {
    let world = |mut world: World| {
        world.voices.truncate(VOICES - 1);
        world
    };
    let heard = hear(&Altered { peer: Oddio, world, frame: |frame| frame });
    assert_eq!(heard.voices, [VOICES - 1, VOICES]);
    assert_eq!(heard.faults(Kind::Stereo), ["not all voices are heard"]);
}

#[test]
fn exchanged_ears_are_noticed() {
    let heard = hear(&Altered { peer: Oddio, world: |world| world, frame: |[left, right]| [right, left] });
    assert_eq!(heard.faults(Kind::Stereo), ["the near ear is not the louder one"]);
}

/// What pans is not taken for a head.
#[test]
fn a_head_that_is_off_is_noticed() {
    let missing = |heard: Heard| heard.faults(Kind::Binaural).len();
    assert_eq!(missing(hear(&Kira)), 2, "neither time nor shadow");
    assert_eq!(missing(hear(&Oddio)), 1, "no shadow");
}
