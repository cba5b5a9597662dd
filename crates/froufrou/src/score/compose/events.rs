//! What happens in a scene by itself, from all that knows of it, in order of time.

use std::iter::Peekable;
use std::sync::mpsc;

use crate::motion::contacts::LogEvents;
use crate::motion::event::Event;
use crate::motion::moving::MovingBodies;
use crate::motion::{moving_cloth, moving_paper};
use crate::scene::Scene;
use crate::scene::world::{RigidBodies, World};
use crate::{Error, Result};

/// So many events, or frames without any, are known ahead at most where it is looked ahead.
const AHEAD: usize = 32;

/// What happens in a scene by itself, told by its contact logs and by how its objects move, in time order.
pub struct Events {
    sources: Vec<Peekable<EventSource>>,
}

type EventSource = Box<dyn Iterator<Item = Result<Event>> + Send>;

impl Events {
    /// Opens the contact logs of a scene, and looks at the objects whose contacts are found from their motion.
    ///
    /// # Errors
    /// A log that cannot be read; an object that is not there, or is no rigid body.
    pub fn open(scene: &Scene, world: &World) -> Result<Self> {
        let happens = |event: &Result<Event>| !matches!(event, Ok(Event::Quiet(_)));
        let moved =
            moved(scene, world)?.into_iter().map(|source| Box::new(source.filter(happens)) as EventSource);
        Ok(Self::of(logged(scene, world)?.into_iter().chain(moved)))
    }

    /// The same for who cannot wait: how objects move is looked at on threads of their own, a little ahead of what is asked
    /// for. Where nothing happens [`Event::Quiet`] says so frame by frame, so that nobody waits for what happens much later.
    ///
    /// # Errors
    /// As [`Events::open`]; no thread.
    pub(crate) fn looking_ahead(scene: &Scene, world: &World) -> Result<Self> {
        let moved = moved(scene, world)?.into_iter().map(ahead).collect::<Result<Vec<_>>>()?;
        Ok(Self::of(logged(scene, world)?.into_iter().chain(moved)))
    }

    fn of(sources: impl Iterator<Item = EventSource>) -> Self {
        Self { sources: sources.map(Iterator::peekable).collect() }
    }

    /// The same, and what is told besides, in order of time.
    #[must_use]
    pub fn and(mut self, told: impl Iterator<Item = Result<Event>> + Send + 'static) -> Self {
        let told: EventSource = Box::new(told);
        self.sources.push(told.peekable());
        self
    }
}

/// What its contact logs tell.
fn logged(scene: &Scene, world: &World) -> Result<Vec<EventSource>> {
    let rigid = RigidBodies::of(scene, world);
    let log = |contacts| Ok(Box::new(LogEvents::open(contacts, rigid.clone())?) as EventSource);
    scene.contacts.iter().map(log).collect()
}

/// What is told by how its objects move: events, and after each frame [`Event::Quiet`].
fn moved(scene: &Scene, world: &World) -> Result<Vec<EventSource>> {
    let mut sources: Vec<EventSource> = Vec::new();
    for touching in &scene.touching {
        let mut bodies = MovingBodies::open(scene, world, touching)?;
        sources.push(Box::new(std::iter::from_fn(move || bodies.next_step())));
    }
    sources.push(Box::new(moving_cloth::events(scene, world)?));
    sources.push(Box::new(moving_paper::events(scene, world)?));
    Ok(sources)
}

/// The same events, which another thread finds. It ends with who asks for them.
fn ahead(source: EventSource) -> Result<EventSource> {
    let (found, coming) = mpsc::sync_channel(AHEAD);
    let find = move || {
        let mut last_s = f64::NEG_INFINITY;
        for event in source {
            // That nothing happens up to a time is worth saying where it was not known yet.
            let is_known =
                matches!(event, Ok(Event::Quiet(time_s)) if !time_s.is_finite() || time_s <= last_s);
            last_s = event.as_ref().map_or(last_s, |event| event.time_s().max(last_s));
            if !is_known && found.send(event).is_err() {
                return;
            }
        }
    };
    let spawned = std::thread::Builder::new().name("froufrou looks".into()).spawn(find);
    spawned.map_err(|fault| Error::new("there is no thread to look at what moves").because(fault))?;
    Ok(Box::new(coming.into_iter()))
}

impl Iterator for Events {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut first: Option<(usize, f64)> = None;
        for (index, source) in self.sources.iter_mut().enumerate() {
            let time_s = match source.peek() {
                None => continue,
                Some(Err(_)) => f64::NEG_INFINITY,
                Some(Ok(event)) => event.time_s(),
            };
            if first.is_none_or(|(_, earliest_s)| time_s < earliest_s) {
                first = Some((index, time_s));
            }
        }
        self.sources[first?.0].next()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Two cloths, two sheets of paper, and a ball among boxes whose contacts are found from their motion.
    const EXAMPLES: [&str; 5] = ["cloth", "flag", "paper-shake", "paper-wall", "tower"];

    #[test]
    fn who_looks_ahead_sees_the_same() {
        for name in EXAMPLES {
            let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples"));
            let scene = Scene::open(folder.join(name).join("scene.toml"), false).unwrap();
            let world = World::open(&scene).unwrap();
            let expected: Vec<Event> = Events::open(&scene, &world).unwrap().map(Result::unwrap).collect();
            assert!(expected.len() > 1, "{name}");
            let (mut found, mut quiet, mut last_s) = (Vec::new(), 0, f64::NEG_INFINITY);
            for event in Events::looking_ahead(&scene, &world).unwrap().map(Result::unwrap) {
                // What is said to be quiet is.
                assert!(event.time_s() >= last_s, "{name}: {event:?} behind {last_s}");
                last_s = event.time_s();
                match event {
                    Event::Quiet(_) => quiet += 1,
                    event => found.push(event),
                }
            }
            assert_eq!(found, expected, "{name}");
            assert!(quiet > 2 && quiet + found.len() > 20, "{name}: said {quiet} times that nothing happens");
        }
    }

    #[test]
    fn nobody_waits_for_what_happens_much_later() {
        // A thousand hours in which nothing does: each frame says so, and few are looked at ahead.
        let looked = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let counted = looked.clone();
        let frames = (0..86_400_000u64).map(move |frame| {
            counted.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            Ok(Event::Quiet(frame as f64 / 24.0))
        });
        let mut source = ahead(Box::new(frames)).unwrap();
        for frame in 0..100u64 {
            assert_eq!(source.next().unwrap().unwrap(), Event::Quiet(frame as f64 / 24.0));
        }
        assert!(looked.load(std::sync::atomic::Ordering::Relaxed) <= 100 + AHEAD + 2);
    }
}
