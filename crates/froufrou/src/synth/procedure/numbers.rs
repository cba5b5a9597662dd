//! Numbers and lists, as scripts reckon with them.

use rhai::{Array, Dynamic, Engine, FuncRegistration, NativeCallContext};

use super::host::{BufferHandle, Told, with, wrong};
use super::limits;

type OfOne = fn(f64) -> f64;
type OfTwo = fn(f64, f64) -> f64;

pub(super) fn register(engine: &mut Engine) {
    collections(engine);
    maths(engine);
}

/// A whole or broken number, if it is one and finite.
pub(crate) fn number(value: &Dynamic) -> Told<f64> {
    let number = match (value.as_float(), value.as_int()) {
        (Ok(float), _) => float,
        (_, Ok(int)) => int as f64,
        _ => return wrong(format!("a number is wanted here, not {}", value.type_name())),
    };
    finite(number)
}

pub(super) fn finite(number: f64) -> Told<f64> {
    if number.is_finite() { Ok(number) } else { wrong(format!("a number is {number}")) }
}

fn collections(engine: &mut Engine) {
    engine.register_fn("buffer", |length: i64| with(|host| host.buffer(length)));
    let at = |buffer: &[f64], index: i64| -> Told<usize> {
        match usize::try_from(index) {
            Ok(at) if at < buffer.len() => Ok(at),
            _ => wrong(format!("there is no [{index}] in a buffer of {}", buffer.len())),
        }
    };
    FuncRegistration::new_index_getter().with_purity(true).register_into_engine(
        engine,
        move |buffer: &mut BufferHandle, index: i64| -> Told<f64> {
            with(|host| {
                let buffer = &host.buffers[buffer.0];
                Ok(buffer[at(buffer, index)?])
            })
        },
    );
    let set = move |buffer: BufferHandle, index: i64, value: f64| {
        let value = finite(value)?;
        with(|host| {
            let buffer = &mut host.buffers[buffer.0];
            let at = at(buffer, index)?;
            buffer[at] = value;
            Ok(())
        })
    };
    FuncRegistration::new_index_setter()
        .with_purity(true)
        .register_into_engine(engine, move |buffer: &mut BufferHandle, index: i64, value: f64| -> Told<()> {
            set(*buffer, index, value)
        });
    FuncRegistration::new_index_setter().with_purity(true).register_into_engine(
        engine,
        move |buffer: &mut BufferHandle, index: i64, value: i64| -> Told<()> {
            set(*buffer, index, value as f64)
        },
    );
    engine.register_fn("len", |buffer: BufferHandle| -> Told<i64> {
        with(|host| Ok(host.buffers[buffer.0].len() as i64))
    });
    FuncRegistration::new("len")
        .with_purity(true)
        .register_into_engine(engine, |array: &mut Array| -> i64 { array.len() as i64 });
    engine.register_fn("push", |context: NativeCallContext, array: &mut Array, value: Dynamic| -> Told<()> {
        if array.len() >= limits::ARRAY {
            return wrong(format!("an array of more than {}", limits::ARRAY));
        }
        context.engine().ensure_data_size_within_limits(&value)?;
        array.push(value);
        Ok(())
    });
}

fn maths(engine: &mut Engine) {
    let of_one: [(&str, OfOne); 13] = [
        ("sin", f64::sin),
        ("cos", f64::cos),
        ("tan", f64::tan),
        ("atan", f64::atan),
        ("tanh", f64::tanh),
        ("exp", f64::exp),
        ("log", f64::ln),
        ("log2", f64::log2),
        ("sqrt", f64::sqrt),
        ("db", |decibels| 10.0_f64.powf(decibels / 20.0)),
        ("semitones", |number| (number / 12.0).exp2()),
        ("float", |x| x),
        ("abs", f64::abs),
    ];
    for (name, of) in of_one {
        engine.register_fn(name, of);
        engine.register_fn(name, move |x: i64| of(x as f64));
    }
    let rounded: [(&str, OfOne); 3] = [("floor", f64::floor), ("ceil", f64::ceil), ("round", f64::round)];
    for (name, of) in rounded {
        engine.register_fn(name, of);
        engine.register_fn(name, |x: i64| x as f64);
    }
    // A conversion that would not fit gives the nearest whole number.
    engine.register_fn("int", |x: f64| -> Told<i64> { Ok(finite(x)? as i64) });
    engine.register_fn("int", |x: i64| x);
    let of_two: [(&str, OfTwo); 3] = [("pow", f64::powf), ("min", f64::min), ("max", f64::max)];
    for (name, of) in of_two {
        engine.register_fn(name, of);
        engine.register_fn(name, move |x: i64, y: i64| of(x as f64, y as f64));
        engine.register_fn(name, move |x: f64, y: i64| of(x, y as f64));
        engine.register_fn(name, move |x: i64, y: f64| of(x as f64, y));
    }
    engine.register_fn("clamp", |x: Dynamic, least: Dynamic, most: Dynamic| -> Told<f64> {
        let [x, least, most] = [number(&x)?, number(&least)?, number(&most)?];
        if least <= most {
            Ok(x.clamp(least, most))
        } else {
            wrong(format!("nothing is from {least} to {most}"))
        }
    });
    engine.register_fn("lerp", |a: Dynamic, b: Dynamic, part: Dynamic| -> Told<f64> {
        let [a, b, part] = [number(&a)?, number(&b)?, number(&part)?];
        Ok(a + (b - a) * part)
    });
    engine.register_fn("random", || with(|host| Ok(host.draw())));
    engine.register_fn("random", |least: Dynamic, most: Dynamic| -> Told<f64> {
        let (least, most) = (number(&least)?, number(&most)?);
        with(|host| Ok(least + (most - least) * host.draw()))
    });
    engine.register_fn("gaussian", || {
        with(|host| {
            // Box & Muller 1958; 1 − u keeps the logarithm finite.
            let (length, angle) = (1.0 - host.draw(), std::f64::consts::TAU * host.draw());
            Ok((-2.0 * length.ln()).sqrt() * angle.cos())
        })
    });
}
