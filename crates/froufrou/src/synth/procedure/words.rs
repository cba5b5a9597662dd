//! The functions that scripts can call beside the language itself.

use rhai::{Array, Dynamic, Engine, FuncRegistration, ImmutableString, NativeCallContext};

use super::graph::Plug;
use super::host::{BufferHandle, Told, UnitHandle, with, wrong};
use super::limits;
use super::numbers;
use super::numbers::{finite, number};
use super::unit::{Event, Kind, Pass};
use super::wave::Wave;

/// Every function, and how it is used.
pub(super) const WORDS: &[(&str, &str)] = &[
    ("param", "param(name, default) or param(name, default, least, most)"),
    ("ring", "ring(seconds)"),
    ("play", "play(unit)"),
    ("sine", "sine(frequency)"),
    ("saw", "saw(frequency)"),
    ("square", "square(frequency)"),
    ("triangle", "triangle(frequency)"),
    ("wave", "wave([amplitude, …], frequency)"),
    ("white", "white()"),
    ("pink", "pink()"),
    ("lowpass1", "lowpass1(input, cutoff)"),
    ("highpass1", "highpass1(input, cutoff)"),
    ("lowpass", "lowpass(input, cutoff) or lowpass(input, cutoff, q)"),
    ("highpass", "highpass(input, cutoff) or highpass(input, cutoff, q)"),
    ("bandpass", "bandpass(input, cutoff) or bandpass(input, cutoff, q)"),
    ("resonator", "resonator(input, frequency, decay)"),
    ("envelope", "envelope(attack, decay, sustain, release)"),
    ("decay", "decay(seconds)"),
    ("line", "line(value)"),
    ("pulse", "pulse()"),
    ("delay", "delay(input, seconds) or delay(input, seconds, longest)"),
    ("value", "value(number)"),
    ("follow", "follow(parameter)"),
    ("sampled", "sampled()"),
    ("mix", "mix([unit, …])"),
    ("on", "envelope.on() or envelope.on(level)"),
    ("off", "envelope.off()"),
    ("hit", "unit.hit(amount) or pulse.hit(amount, contact)"),
    ("to", "line.to(value, seconds)"),
    ("buffer", "buffer(length)"),
    ("len", "len(array) or len(buffer)"),
    ("push", "array.push(value)"),
    ("random", "random() or random(least, most)"),
    ("gaussian", "gaussian()"),
    ("sin", "sin(x)"),
    ("cos", "cos(x)"),
    ("tan", "tan(x)"),
    ("atan", "atan(x)"),
    ("tanh", "tanh(x)"),
    ("exp", "exp(x)"),
    ("log", "log(x)"),
    ("log2", "log2(x)"),
    ("sqrt", "sqrt(x)"),
    ("abs", "abs(x)"),
    ("floor", "floor(x)"),
    ("ceil", "ceil(x)"),
    ("round", "round(x)"),
    ("pow", "pow(x, y)"),
    ("min", "min(x, y)"),
    ("max", "max(x, y)"),
    ("clamp", "clamp(x, least, most)"),
    ("lerp", "lerp(a, b, part)"),
    ("db", "db(decibels)"),
    ("semitones", "semitones(number)"),
    ("float", "float(x)"),
    ("int", "int(x)"),
    ("print", "print(anything)"),
];

/// The names that stand for something everywhere.
pub(super) const NAMES: &[&str] = &["time", "sample_rate", "PI", "TAU"];

/// The names of inputs, which are properties of units.
pub(super) const PROPERTIES: &[&str] = &[
    "frequency",
    "jitter",
    "cutoff",
    "q",
    "decay",
    "attack",
    "sustain",
    "release",
    "seconds",
    "feedback",
    "value",
];

pub(super) fn is_known(name: &str) -> bool {
    NAMES.contains(&name) || WORDS.iter().any(|(word, _)| *word == name)
}

pub(super) fn usage(name: &str) -> &'static str {
    WORDS.iter().find(|(word, _)| *word == name).map_or("", |(_, usage)| usage)
}

/// The word that a misspelt one is nearest to.
pub(super) fn nearest(name: &str) -> Option<&'static str> {
    let near = |word: &str| strsim::jaro_winkler(word, name);
    WORDS
        .iter()
        .map(|&(word, _)| (near(word), word))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, word)| word)
}

fn plug(value: &Dynamic) -> Told<Plug> {
    match value.clone().try_cast::<UnitHandle>() {
        Some(UnitHandle(unit)) => Ok(Plug::Unit(unit)),
        None if value.is_float() || value.is_int() => number(value).map(Plug::Number),
        None => wrong(format!("a number or a unit is wanted here, not {}", value.type_name())),
    }
}

pub(super) fn register(engine: &mut Engine) {
    engine.register_type_with_name::<UnitHandle>("unit");
    engine.register_type_with_name::<BufferHandle>("buffer");
    declarations(engine);
    sources(engine);
    processors(engine);
    operators(engine);
    properties(engine);
    events(engine);
    numbers::register(engine);
}

fn declarations(engine: &mut Engine) {
    const WIDEST: f64 = 1e9;
    engine.register_fn("param", |name: ImmutableString, default: Dynamic| -> Told<f64> {
        let default = number(&default)?;
        with(|host| host.declare(&name, default, -WIDEST, WIDEST))?;
        with(|host| Ok(host.parameters.last().map_or(default, |parameter| parameter.value)))
    });
    engine.register_fn(
        "param",
        |name: ImmutableString, default: Dynamic, least: Dynamic, most: Dynamic| -> Told<f64> {
            let [default, least, most] = [number(&default)?, number(&least)?, number(&most)?];
            with(|host| host.declare(&name, default, least, most))?;
            with(|host| Ok(host.parameters.last().map_or(default, |parameter| parameter.value)))
        },
    );
    engine.register_fn("ring", |seconds: Dynamic| -> Told<()> {
        let seconds = number(&seconds)?;
        if !(0.0..=1e4).contains(&seconds) {
            return wrong(format!("it rings for {seconds} s, not from 0 to 10000"));
        }
        with(|host| {
            host.building()?;
            host.ring_s = Some(seconds);
            Ok(())
        })
    });
    engine.register_fn("play", |unit: UnitHandle| {
        with(|host| {
            host.building()?;
            host.graph.play(unit.0).or_else(wrong)
        })
    });
}

fn sources(engine: &mut Engine) {
    type Shape = fn() -> std::sync::Arc<Wave>;
    let shapes: [(&'static str, Shape); 4] =
        [("sine", Wave::sine), ("saw", Wave::saw), ("square", Wave::square), ("triangle", Wave::triangle)];
    for (name, shape) in shapes {
        engine.register_fn(name, move |context: NativeCallContext, frequency: Dynamic| {
            let frequency = plug(&frequency)?;
            with(|host| {
                let kind = Kind::oscillator(name, shape(), host.unit_random());
                host.unit(kind, &[frequency], context.call_position())
            })
        });
    }
    engine.register_fn("wave", |context: NativeCallContext, harmonics: Array, frequency: Dynamic| {
        let frequency = plug(&frequency)?;
        let harmonics: Vec<f64> = harmonics.iter().map(number).collect::<Told<_>>()?;
        if harmonics.is_empty() || harmonics.len() > limits::HARMONICS {
            return wrong(format!(
                "a wave has 1 to {} harmonics, not {}",
                limits::HARMONICS,
                harmonics.len()
            ));
        }
        if harmonics.iter().any(|amplitude| amplitude.abs() > 1e6) {
            return wrong("an amplitude is above 1000000");
        }
        with(|host| {
            host.building()?;
            let kind = Kind::oscillator("wave", host.wave(&harmonics), host.unit_random());
            host.unit(kind, &[frequency], context.call_position())
        })
    });
    engine.register_fn("white", |context: NativeCallContext| {
        with(|host| host.unit(Kind::White(host.unit_random()), &[], context.call_position()))
    });
    engine.register_fn("pink", |context: NativeCallContext| {
        with(|host| host.unit(Kind::pink(host.unit_random(), host.rate_hz), &[], context.call_position()))
    });
    engine.register_fn("value", |context: NativeCallContext, value: Dynamic| {
        let value = number(&value)?;
        with(|host| host.unit(Kind::Value, &[Plug::Number(value)], context.call_position()))
    });
    engine.register_fn("line", |context: NativeCallContext, value: Dynamic| {
        let value = number(&value)?;
        with(|host| host.unit(Kind::line(value), &[], context.call_position()))
    });
    engine.register_fn("pulse", |context: NativeCallContext| {
        with(|host| host.unit(Kind::pulse(), &[], context.call_position()))
    });
    engine.register_fn("sampled", |context: NativeCallContext| {
        with(|host| host.unit(Kind::Sampled, &[], context.call_position()))
    });
    engine.register_fn("follow", |context: NativeCallContext, name: ImmutableString| {
        with(|host| {
            let Some(index) = host.parameters.iter().position(|parameter| parameter.name == name.as_str())
            else {
                return wrong(format!("there is no parameter `{name}`"));
            };
            host.unit(Kind::Follow(index), &[], context.call_position())
        })
    });
    engine.register_fn(
        "envelope",
        |context: NativeCallContext, a: Dynamic, d: Dynamic, s: Dynamic, r: Dynamic| {
            let plugs = [number(&a)?, number(&d)?, number(&s)?, number(&r)?].map(Plug::Number);
            with(|host| host.unit(Kind::envelope(), &plugs, context.call_position()))
        },
    );
    engine.register_fn("decay", |context: NativeCallContext, seconds: Dynamic| {
        let seconds = plug(&seconds)?;
        with(|host| host.unit(Kind::decay(), &[seconds], context.call_position()))
    });
}

fn processors(engine: &mut Engine) {
    for (name, pass) in [("lowpass1", Pass::Low), ("highpass1", Pass::High)] {
        engine.register_fn(name, move |context: NativeCallContext, input: UnitHandle, cutoff: Dynamic| {
            let plugs = [Plug::Unit(input.0), plug(&cutoff)?];
            with(|host| host.unit(Kind::one_pole(pass), &plugs, context.call_position()))
        });
    }
    for (name, pass) in [("lowpass", Pass::Low), ("highpass", Pass::High), ("bandpass", Pass::Band)] {
        engine.register_fn(name, move |context: NativeCallContext, input: UnitHandle, cutoff: Dynamic| {
            // Butterworth's.
            let q = Plug::Number(std::f64::consts::FRAC_1_SQRT_2);
            let plugs = [Plug::Unit(input.0), plug(&cutoff)?, q];
            with(|host| host.unit(Kind::two_pole(pass), &plugs, context.call_position()))
        });
        engine.register_fn(
            name,
            move |context: NativeCallContext, input: UnitHandle, cutoff: Dynamic, q: Dynamic| {
                let plugs = [Plug::Unit(input.0), plug(&cutoff)?, plug(&q)?];
                with(|host| host.unit(Kind::two_pole(pass), &plugs, context.call_position()))
            },
        );
    }
    engine.register_fn(
        "resonator",
        |context: NativeCallContext, input: UnitHandle, frequency: Dynamic, decay: Dynamic| {
            let plugs = [Plug::Unit(input.0), plug(&frequency)?, plug(&decay)?];
            with(|host| host.unit(Kind::resonator(), &plugs, context.call_position()))
        },
    );
    engine.register_fn("delay", |context: NativeCallContext, input: UnitHandle, seconds: Dynamic| {
        let seconds = number(&seconds)?;
        with(|host| host.delay(Plug::Unit(input.0), Plug::Number(seconds), seconds, context.call_position()))
    });
    engine.register_fn(
        "delay",
        |context: NativeCallContext, input: UnitHandle, seconds: Dynamic, longest: Dynamic| {
            let (seconds, longest_s) = (plug(&seconds)?, number(&longest)?);
            with(|host| host.delay(Plug::Unit(input.0), seconds, longest_s, context.call_position()))
        },
    );
    engine.register_fn("tanh", |context: NativeCallContext, input: UnitHandle| {
        with(|host| host.unit(Kind::Tanh, &[Plug::Unit(input.0)], context.call_position()))
    });
    engine.register_fn("abs", |context: NativeCallContext, input: UnitHandle| {
        with(|host| host.unit(Kind::Abs, &[Plug::Unit(input.0)], context.call_position()))
    });
    engine.register_fn("mix", |context: NativeCallContext, units: Array| {
        let mut sum: Option<UnitHandle> = None;
        for unit in &units {
            let Some(unit) = unit.clone().try_cast::<UnitHandle>() else {
                return wrong(format!("mix takes a list of units, not of {}", unit.type_name()));
            };
            sum = Some(match sum {
                None => unit,
                Some(sum) => {
                    let plugs = [Plug::Unit(sum.0), Plug::Unit(unit.0)];
                    with(|host| host.unit(Kind::Sum, &plugs, context.call_position()))?
                }
            });
        }
        sum.map_or_else(|| wrong("mix takes at least one unit"), Ok)
    });
}

fn operators(engine: &mut Engine) {
    type Make = fn() -> Kind;
    let operators: [(&str, Make); 3] =
        [("+", || Kind::Sum), ("-", || Kind::Difference), ("*", || Kind::Product)];
    for (name, kind) in operators {
        let make = move |context: NativeCallContext, a: Plug, b: Plug| {
            with(|host| host.unit(kind(), &[a, b], context.call_position()))
        };
        engine.register_fn(name, move |context: NativeCallContext, a: UnitHandle, b: UnitHandle| {
            make(context, Plug::Unit(a.0), Plug::Unit(b.0))
        });
        engine.register_fn(name, move |context: NativeCallContext, a: UnitHandle, b: f64| {
            make(context, Plug::Unit(a.0), Plug::Number(finite(b)?))
        });
        engine.register_fn(name, move |context: NativeCallContext, a: UnitHandle, b: i64| {
            make(context, Plug::Unit(a.0), Plug::Number(b as f64))
        });
        engine.register_fn(name, move |context: NativeCallContext, a: f64, b: UnitHandle| {
            make(context, Plug::Number(finite(a)?), Plug::Unit(b.0))
        });
        engine.register_fn(name, move |context: NativeCallContext, a: i64, b: UnitHandle| {
            make(context, Plug::Number(a as f64), Plug::Unit(b.0))
        });
    }
    engine.register_fn("-", |context: NativeCallContext, a: UnitHandle| {
        let plugs = [Plug::Unit(a.0), Plug::Number(-1.0)];
        with(|host| host.unit(Kind::Product, &plugs, context.call_position()))
    });
    engine.register_fn("/", |context: NativeCallContext, a: UnitHandle, b: Dynamic| {
        let plugs = [Plug::Unit(a.0), Plug::Number(finite(number(&b)?.recip())?)];
        with(|host| host.unit(Kind::Product, &plugs, context.call_position()))
    });
}

/// `unit.name` and `unit.name = …`. They change nothing of the handle itself, so that a constant may
/// hold it.
fn properties(engine: &mut Engine) {
    let set = |unit: UnitHandle, name: &str, plug: Plug| {
        with(|host| {
            if let Plug::Unit(_) = plug {
                host.building()?;
            }
            host.graph.plug(unit.0, name, plug).or_else(wrong)
        })
    };
    for &name in PROPERTIES {
        let setter = || FuncRegistration::new_setter(name).with_purity(true);
        setter().register_into_engine(engine, move |unit: &mut UnitHandle, value: f64| -> Told<()> {
            set(*unit, name, Plug::Number(value))
        });
        setter().register_into_engine(engine, move |unit: &mut UnitHandle, value: i64| -> Told<()> {
            set(*unit, name, Plug::Number(value as f64))
        });
        setter().register_into_engine(engine, move |unit: &mut UnitHandle, value: UnitHandle| -> Told<()> {
            set(*unit, name, Plug::Unit(value.0))
        });
        FuncRegistration::new_getter(name).with_purity(true).register_into_engine(
            engine,
            move |unit: &mut UnitHandle| -> Told<f64> {
                match with(|host| host.graph.number(unit.0, name).or_else(wrong))? {
                    Some(number) => Ok(number),
                    None => wrong(format!("`{name}` is driven by a unit and has no number")),
                }
            },
        );
    }
}

fn events(engine: &mut Engine) {
    engine.register_fn("on", |unit: UnitHandle| with(|host| host.happen(unit, Event::On(1.0))));
    engine.register_fn("on", |unit: UnitHandle, level: Dynamic| {
        let level = amount(&level)?;
        with(|host| host.happen(unit, Event::On(level)))
    });
    engine.register_fn("off", |unit: UnitHandle| with(|host| host.happen(unit, Event::Off)));
    engine.register_fn("hit", |unit: UnitHandle, level: Dynamic| {
        let level = amount(&level)?;
        with(|host| host.happen(unit, Event::Hit(level, 0.0)))
    });
    engine.register_fn("hit", |unit: UnitHandle, level: Dynamic, contact: Dynamic| {
        let (level, contact) = (amount(&level)?, number(&contact)?);
        if !(0.0..=1.0).contains(&contact) {
            return wrong(format!("the striker touches for {contact} s, not from 0 to 1"));
        }
        with(|host| host.happen(unit, Event::Hit(level, contact)))
    });
    engine.register_fn("to", |unit: UnitHandle, value: Dynamic, seconds: Dynamic| {
        let (value, seconds) = (amount(&value)?, number(&seconds)?);
        if !(0.0..=1e4).contains(&seconds) {
            return wrong(format!("a line takes {seconds} s, not from 0 to 10000"));
        }
        with(|host| host.happen(unit, Event::To(value, seconds)))
    });
}

fn amount(value: &Dynamic) -> Told<f64> {
    let amount = number(value)?;
    if amount.abs() <= 1e9 { Ok(amount) } else { wrong(format!("{amount} is above 1000000000")) }
}
