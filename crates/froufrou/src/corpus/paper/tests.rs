use super::*;

fn printer() -> PaperSound {
    PaperSound::named("synthetic/printer", Path::new("")).unwrap()
}

#[test]
fn a_model_has_what_the_paper_recorded() {
    let sound = printer();
    assert_eq!(sound.places().len(), 82);
    assert_eq!(sound.clips().len(), 9 + 81 * 3);
    assert_eq!(sound.spectra().len(), 3 + 81);
    for place in sound.places() {
        let (clips, spectra) = if place.is_constrained() { (9, 3) } else { (3, 1) };
        assert_eq!((place.clips.len(), place.spectra.len()), (clips, spectra));
        let is_of = |number: &usize| sound.clips()[*number].border_m == place.border_m;
        assert!(place.clips.iter().all(is_of));
        assert!(place.spectra.iter().all(|number| sound.spectra()[*number].ruling_m == place.ruling_m));
    }
    for (number, clip) in sound.clips().iter().enumerate().step_by(31) {
        let samples = sound.clip_samples(number, 48_000).unwrap();
        assert_eq!(samples.len(), (clip.length_s * 48_000.0).round() as usize);
        assert_eq!(samples, sound.clip_samples(number, 48_000).unwrap());
        let allowed = if clip.border_m > 0.0 { 0.2..=0.8 } else { 0.002..=0.02 };
        assert!(allowed.contains(&clip.length_s));
    }
    assert!(sound.clip_samples(0, 0).is_err());
    assert!(sound.clip_samples(9999, 48_000).unwrap().is_empty());
    assert!(PaperSound::named("synthetic/silk", Path::new("")).is_err());
    assert!(PaperSound::named("nowhere", Path::new("/tmp")).is_err());
}

#[test]
fn the_nearest_size_is_taken_and_never_the_same_clip_twice_running() {
    let sound = printer();
    let random = Random::new(5, 5);
    for (ruling_m, border_m, wanted) in [
        (0.11, 0.21, (0.1, 0.2)),
        (0.9, 0.03, (0.3, 0.025)),
        (0.2, 0.0, (0.0, 0.0)),
        (0.0, 0.0, (0.0, 0.0)),
        (0.001, 0.001, (0.025, 0.025)),
    ] {
        let (mut last, mut seen) = (None, std::collections::BTreeMap::new());
        for index in 0..3000 {
            let clip = sound.clip(ruling_m, border_m, last, random, index).unwrap();
            assert_ne!(Some(clip), last);
            assert_eq!((sound.clips()[clip].ruling_m, sound.clips()[clip].border_m), wanted);
            // What was taken is a function of where it was asked for.
            assert_eq!(sound.clip(ruling_m, border_m, last, random, index), Some(clip));
            last = Some(clip);
            *seen.entry(clip).or_insert(0) += 1;
        }
        // All are heard, about as often.
        let count = if wanted.1 > 0.0 { FLAPS } else { CLACS };
        assert_eq!(seen.len(), count);
        assert!(seen.values().all(|n| (n * count).abs_diff(3000) < 600), "{seen:?}");
        let spectrum = sound.spectrum(ruling_m, border_m).unwrap();
        let entry = &sound.spectra()[spectrum];
        assert_eq!((entry.ruling_m, entry.border_m), wanted);
        assert!(sound.spectra_at(ruling_m, border_m).contains(&spectrum));
    }
}

/// A database with these clips and spectra, each by its size.
fn database(clips: &[(f64, f64)], spectra: &[(f64, f64)]) -> PaperSound {
    let clip = |&(ruling_m, border_m): &(f64, f64)| ClipEntry {
        ruling_m,
        border_m,
        from: String::new(),
        begin_s: 0.0,
        length_s: 0.001,
        lead_s: 0.0,
    };
    let spectrum = |&(ruling_m, border_m): &(f64, f64)| SpectrumEntry {
        ruling_m,
        border_m,
        from: String::new(),
        density: vec![1.0; BINS],
    };
    let samples = clips.iter().map(|_| (48_000, Arc::from([0.5f32; 48]))).collect();
    let (clips, spectra) = (clips.iter().map(clip).collect(), spectra.iter().map(spectrum).collect());
    PaperSound::new("few".to_owned(), clips, spectra, Clips::Recorded(samples), Paper::printer())
}

#[test]
fn databases_with_little_in_them_give_what_they_have() {
    let random = Random::new(1, 1);
    let sound = database(&[(0.1, 0.1), (0.2, 0.1), (0.2, 0.1)], &[(0.0, 0.0)]);
    // One clip at the nearest place: the next place gives the other.
    assert_eq!(sound.clip(0.1, 0.1, None, random, 0), Some(0));
    assert!(sound.clip(0.1, 0.1, Some(0), random, 1).is_some_and(|clip| clip > 0));
    assert_eq!(sound.clip(0.1, 0.0, None, random, 0), None);
    assert_eq!((sound.spectrum(0.1, 0.1), sound.spectrum(0.1, 0.0)), (None, Some(0)));
    // One clip in all.
    let sound = database(&[(0.1, 0.1)], &[]);
    assert_eq!(sound.clip(0.1, 0.1, Some(0), random, 0), Some(0));
    assert_eq!(sound.clip_samples(0, 96_000).unwrap().len(), 96);
}
