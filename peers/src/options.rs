//! What is asked on the command line.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use crate::measure::Plan;
use crate::peers::Result;
use crate::plain;

pub const HELP: &str = "\
What a voice costs beside other engines.

  --voices 16,64,256,1000   how many sound at once
  --seconds 0.25            how long they sound in each repeat
  --repeats 15              how often each is measured; the median is told
  --block 1024              frames rendered at a time; 128 by default with --plain
  --only NAME,NAME          these rows alone
  --head FILE.sofa          the measured head, for all that take one; else MIT_KEMAR_normal_pinna.sofa in the
                            folder hrtf of FROUFROU_DATA or of ../shared/data
  --plain                   voices that stand still instead, with a gain and a pan: all rows of these
  --check                   listen to what each renders, instead of measuring

PHONON_LIBRARY names the library of Steam Audio.";

#[derive(Debug)]
pub struct Options {
    pub voices: Vec<usize>,
    pub plan: Plan,
    pub only: Vec<String>,
    pub head: Option<PathBuf>,
    pub check: bool,
    pub plain: bool,
}

/// `None` where help is asked for.
pub fn read(mut arguments: impl Iterator<Item = String>) -> Result<Option<Options>> {
    let mut options = Options {
        voices: vec![16, 64, 256, 1000],
        plan: Plan { block: 1024, seconds: 0.25, repeats: 15 },
        only: Vec::new(),
        head: known_head(),
        check: false,
        plain: false,
    };
    let (mut block, mut not_plain) = (None, None);
    while let Some(name) = arguments.next() {
        if ["--check", "--only", "--head"].contains(&name.as_str()) {
            not_plain = Some(name.clone());
        }
        let mut value = || arguments.next().ok_or(format!("{name} wants a value"));
        match name.as_str() {
            "--help" | "-h" => return Ok(None),
            "--check" => options.check = true,
            "--plain" => options.plain = true,
            "--voices" => {
                let counts = value()?;
                options.voices =
                    counts.split(',').map(|n| number(&name, n, 1, 1000)).collect::<Result<_>>()?
            }
            "--seconds" => options.plan.seconds = number(&name, &value()?, 0.1, 60.0)?,
            "--repeats" => options.plan.repeats = number(&name, &value()?, 1, 1000)?,
            "--block" => block = Some(number(&name, &value()?, 64, 2048)?),
            "--only" => options.only = value()?.split(',').map(str::to_string).collect(),
            "--head" => options.head = Some(value()?.into()),
            _ => return Err(format!("{name} is not known; --help tells what is")),
        }
    }
    if let Some(name) = not_plain.filter(|_| options.plain) {
        return Err(format!("{name} is not for --plain"));
    }
    options.plan.block = block.unwrap_or(if options.plain { plain::BLOCK } else { 1024 });
    Ok(Some(options))
}

fn number<N: std::str::FromStr + PartialOrd + Display>(
    name: &str,
    text: &str,
    least: N,
    most: N,
) -> Result<N> {
    let said = format!("{name} wants numbers from {least} to {most}, not {text}");
    text.trim().parse().ok().filter(|n| (least..=most).contains(n)).ok_or(said)
}

fn known_head() -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data =
        std::env::var_os("FROUFROU_DATA").map_or_else(|| here.join("../../shared/data"), PathBuf::from);
    Some(data.join("hrtf/MIT_KEMAR_normal_pinna.sofa")).filter(|file| file.exists())
}
