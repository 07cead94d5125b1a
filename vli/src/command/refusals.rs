//! What is refused before anything is read: options that are not served yet, and those that would have no effect
//! beside others, because who gives them expects one.

use super::arguments::{
    Architecture, Blend, Input, Look, Modulated, Render, RendererName, Simd, Switch, name,
};
use super::error::Error;
use super::lists::{Device, Numbers};
use super::look;

/// A rule: whether it refuses, the option, and what is wrong with it.
type Rule<'a> = (bool, &'static str, &'a str);

fn apply(rules: &[Rule<'_>]) -> Result<(), Error> {
    match rules.iter().find(|(refused, ..)| *refused) {
        Some((_, option, why)) => Err(Error::input(format!("{option} {why}"))),
        None => Ok(()),
    }
}

/// Refuses a command that is not served yet.
pub fn command(name: &str) -> Result<(), Error> {
    Err(Error::input(format!("{name}: this command is not served yet")))
}

/// Refuses arguments of `render`.
pub fn render(arguments: &Render) -> Result<(), Error> {
    unserved(arguments)?;
    let Render { view, card, .. } = arguments;
    let ideal = card.renderer == Some(RendererName::Ideal);
    let simd = card.simd.is_some_and(|level| level != Simd::Auto);
    apply(&[
        (view.position.is_some() && view.focal.is_none(), "--position", "wants --focal too"),
        (view.focal.is_some() && view.position.is_none(), "--focal", "wants --position too"),
        (ideal && card.device != Device::Embedded, "--device", "has no effect with --renderer ideal"),
        (ideal && simd, "--simd", "has no effect with --renderer ideal"),
        (ideal && card.threads.is_some(), "--threads", "has no effect with --renderer ideal"),
        (ideal && card.sections, "--sections", "has no effect with --renderer ideal"),
        (ideal && arguments.explain.is_some(), "--explain", "has no effect with --renderer ideal"),
        (ideal && card.keep.mask() != 0, "--keep", "has no effect with --renderer ideal"),
    ])?;
    appearance(&arguments.look)?;
    input(&arguments.input, arguments.volume.is_some())
}

fn unserved(arguments: &Render) -> Result<(), Error> {
    if let Some(architecture) = arguments.card.architecture.filter(|it| *it != Architecture::Vg500) {
        return Err(Error::input(format!("--architecture {} is not served yet", name(architecture))));
    }
    Ok(())
}

fn appearance(look: &Look) -> Result<(), Error> {
    let modulates = |what| look.modulate.contains(&what);
    let extreme = matches!(look.blend, Blend::Mip | Blend::Minip);
    let unlit = match look.shading {
        Some(Switch::Off) => "has no effect with --shading off".into(),
        _ => format!("has no effect with --blend {} unless --shading is on", name(look.blend)),
    };
    let dark = !look::is_shaded(look);
    let Numbers([_, diffuse, specular, _]) = look::material(look);
    apply(&[
        (dark && !look.light.is_empty(), "--light", &unlit),
        (dark && look.material.is_some(), "--material", &unlit),
        (dark && modulates(Modulated::Diffuse), "--modulate diffuse", &unlit),
        (dark && modulates(Modulated::Specular), "--modulate specular", &unlit),
        (
            diffuse == 0.0 && specular == 0.0 && !look.light.is_empty(),
            "--light",
            "has no effect with a --material that is neither diffuse nor specular",
        ),
        (
            diffuse == 0.0 && modulates(Modulated::Diffuse),
            "--modulate diffuse",
            "has no effect with a --material that is not diffuse",
        ),
        (
            specular == 0.0 && modulates(Modulated::Specular),
            "--modulate specular",
            "has no effect with a --material that is not specular",
        ),
        (
            extreme && modulates(Modulated::Opacity),
            "--modulate opacity",
            "has no effect with --blend mip and minip, which show a sample whatever its opacity",
        ),
        (
            look.gradient_table.is_some() && look.modulate.is_empty(),
            "--gradient-table",
            "has no effect without --modulate",
        ),
    ])
}

/// Refuses arguments about files; `has_file` tells whether one is read.
pub fn input(input: &Input, has_file: bool) -> Result<(), Error> {
    let headerless = input.raw_shape.is_some();
    apply(&[
        (headerless && input.raw_type.is_none(), "--raw-shape", "wants --raw-type too"),
        (!headerless && input.raw_type.is_some(), "--raw-type", "has no effect without --raw-shape"),
        (!headerless && input.raw_endian.is_some(), "--raw-endian", "has no effect without --raw-shape"),
        (!headerless && input.raw_spacing.is_some(), "--raw-spacing", "has no effect without --raw-shape"),
        (!has_file && headerless, "--raw-shape", "has no effect without VOLUME, the file to read"),
        (
            !has_file && input.nan.is_some(),
            "--nan",
            "has no effect without VOLUME: phantoms hold only numbers",
        ),
    ])
}
