"""One function a command: from parsed options to an object for --json, printing on the way for people."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from . import console, plots
from .brdf import Brdf, OnLattice
from .describe import (
    UNKNOWN,
    clamped,
    compact_rows,
    compression_rows,
    describe,
    fact_rows,
    image_rows,
    label,
    lookup,
    origin_rows,
    print_fits,
    table_rows,
    text,
    trained,
)
from .errors import FormatError, MaterialError, MissingDependencyError, OptionError, SommerlError
from .factored import file as fbrdf
from .factored.fit import FactorOptions
from .factored.fit import factor as factored
from .files import check_writable
from .fitting.fit import fit as fit_model
from .fitting.fit import fit_all
from .fitting.options import FitOptions, families_of
from .formats import fits
from .formats.names import split_member
from .load import EXTENSIONS, interpolated, load, load_table
from .metrics import table_metrics
from .models.multi_lobe import MultiLobe
from .render.checkpoint import Checkpoint
from .render.compare import compare_on_sphere, judge_on_sphere
from .render.environment import default_environment, load_environment
from .render.images import side_by_side, write_image
from .render.llvm import require_compiler
from .render.passes import LARGEST_SIZE
from .som_man import budget
from .som_man import file as smrl
from .som_man.budget import CompactOptions
from .som_man.material import SomManBrdf
from .som_man.options import TrainOptions
from .table import BrdfTable

SMALLEST_SIZE = 8  # SSIM looks at windows of 7 pixels
MOST_SPP = 2**20
HIDDEN = ("facts", "lobes", "made_from", "measured_against")  # keys that `info` shows for people in rows of their own


def compress(options: Namespace) -> dict[str, Any]:
    targets = options.target_size, options.target_psnr
    compact = (options.preset or ("paper" if targets == (None, None) else "compact")) == "compact"
    method = _compact_options(options) if compact else _train_options(options)
    outputs = _outputs(options.inputs, options.output)
    if len(options.inputs) > 1:
        for source in options.inputs:
            load(source)  # so that a bad one is found before hours are spent on the others
    results: list[dict[str, Any]] = []
    failed = 0
    for source, output in zip(options.inputs, outputs, strict=True):
        try:
            results.append(_compressed(source, output, method, options.json))
        except SommerlError as error:  # a target out of one material's reach is no reason to leave out the others
            if len(options.inputs) == 1:
                raise
            failed += 1
            console.tell(f"error: {error}")
    if failed:
        raise MaterialError(f"inputs: expected to compress {len(options.inputs)} materials, found {failed} that failed")
    return results[0] if len(results) == 1 else {"materials": results}


def _compressed(source: str, output: Path, method: CompactOptions | TrainOptions, quiet: bool) -> dict[str, Any]:
    if isinstance(method, CompactOptions):
        return compact_one(load(source), output, method, quiet)
    return compress_one(load_table(source), output, method, quiet)


def _compact_options(options: Namespace) -> CompactOptions:
    for name, default in asdict(TrainOptions()).items():
        if name != "seed" and getattr(options, name) != default:
            raise OptionError(f"{name}: expected --preset paper, found compact")
    return CompactOptions(options.target_size, options.target_psnr, options.seed)


def _train_options(options: Namespace) -> TrainOptions:
    for name in ("target_size", "target_psnr"):
        if getattr(options, name) is not None:
            raise OptionError(f"{name}: expected --preset compact, found paper")
    return TrainOptions(**{field.name: getattr(options, field.name) for field in fields(TrainOptions)})


def _outputs(inputs: list[str], output: Path) -> list[Path]:
    """Where each input goes."""
    if len(inputs) == 1 and not output.is_dir():
        outputs = [output]
    elif output.is_dir():
        outputs = [output / f"{stem(source)}.smrl" for source in inputs]
    else:
        raise OptionError(f"{output}: expected a folder that exists, for several inputs")
    if len(set(outputs)) < len(outputs):
        raise OptionError("inputs: expected different names, found two that would be written to one file")
    for source, path in zip(inputs, outputs, strict=True):
        check_output(path, (".smrl",), source)
    return outputs


def stem(source: str) -> str:
    path, member = split_member(source)
    return member or (path.stem if path.suffix.lower() in EXTENSIONS else path.name)


def compress_one(table: BrdfTable, output: Path, options: TrainOptions, quiet: bool) -> dict[str, Any]:
    material, report = trained(table, options)
    written = smrl.save(material, output)
    result = describe(material, written) | asdict(report) | {"epochs": options.epochs, "output": str(output)}
    if not quiet:
        console.print_rows(f"{material.name} → {output}", compression_rows(material, written, report))
    return result


def compact_one(brdf: Brdf, output: Path, options: CompactOptions, quiet: bool) -> dict[str, Any]:
    with console.progress(f"compressing {brdf.name}") as advance:
        material, report = budget.compress(brdf, options, quality=_judge(brdf, options), progress=advance)
    written = smrl.save(material, output)
    result = describe(material, written) | {"options": asdict(options), "psnr_object_db": report.psnr_db}
    counted = clamped(brdf)
    result |= {"seconds": report.seconds, "output": str(output), **counted}
    result |= dict.fromkeys(("epochs", "quantisation_error", "units_dropped"))
    if not quiet:
        console.print_rows(f"{material.name} → {output}", compact_rows(material, written, report, counted))
    return result


def _judge(brdf: Brdf, options: CompactOptions) -> budget.Quality | None:
    """The renderer; without it or a compiler for it, the fit's own error has to do where a size is asked for."""
    try:
        require_compiler()
        return judge_on_sphere(brdf, default_environment())
    except MissingDependencyError:
        if options.target_size is None:
            raise
        return None


def info(options: Namespace) -> dict[str, Any]:
    brdf = load(options.material)
    path = Path(options.material)
    on_disk = path.stat().st_size if path.is_file() else None
    result = describe(brdf, on_disk)
    if not options.json:
        apart = (*HIDDEN, *UNKNOWN)
        shown = {key: value for key, value in result.items() if value not in (None, "", {}) and key not in apart}
        for key in ("bytes_paper", "bytes_memory", "bytes_disk"):
            if key in shown:
                shown[key] = console.size(shown[key])
        counted = {key: result[key] for key in UNKNOWN if result["cells_clamped"] is not None}
        rows = {key: text(value) for key, value in shown.items()}
        rows |= fact_rows(counted | (result["facts"] or {})) | origin_rows(brdf)
        if isinstance(brdf, MultiLobe):
            rows |= {f"lobe {number}": str(lobe) for number, lobe in enumerate(brdf.lobes, 1)}
        console.print_rows(str(options.material), rows)
    return result


def compare(options: Namespace) -> dict[str, Any]:
    if options.output:
        check_output(options.output, (".png",), options.reference, options.candidate, options.envmap)
    reference, candidate = alike(load(options.reference), load(options.candidate), options.lookup)
    check_rendering(options)
    warnings = console.Warnings()
    environment = environment_of(options, warnings)
    with console.progress("rendering") as advance:
        comparison = compare_on_sphere(
            reference,
            [candidate],
            environment,
            size=options.size,
            spp=options.spp,
            seed=options.seed,
            progress=advance,
        )[0]
    if options.output:
        write_image(options.output, side_by_side(comparison.pictures()))
    metrics = table_distance(reference, candidate)
    result = asdict(comparison.metrics) | {f"table_{name}": value for name, value in metrics.items()}
    result |= {"reference": label(reference), "candidate": label(candidate), "warnings": warnings.told}
    if options.output:
        result["image"] = str(options.output)
    if not options.json:
        lookups = dict.fromkeys((lookup(reference), lookup(candidate)))
        rows = {"lookup": " against ".join(lookups)} | image_rows(comparison.metrics) | table_rows(metrics)
        console.print_rows(f"{options.reference} against {options.candidate}", rows)
    return result


def fit(options: Namespace) -> dict[str, Any]:
    for path, extension in ((options.output, ".json"), (options.picture, ".png")):
        if path:
            check_output(path, (extension,), options.material)
    chosen = FitOptions(**{field.name: getattr(options, field.name) for field in fields(FitOptions)})
    every = options.model == "all"
    if not every:
        families_of(options.model, chosen.lobes)  # an unknown one is better told before reading
    brdf = load(options.material)
    with console.progress(f"fitting {brdf.name}") as advance:
        found = (
            fit_all(brdf, chosen, progress=advance)
            if every
            else [fit_model(brdf, options.model, chosen, progress=advance)]
        )
    result = fits.content(brdf.name, [each.as_json() for each in found])
    if options.picture:
        with console.progress("rendering") as advance:
            comparisons = compare_on_sphere(
                brdf, [each.brdf for each in found], default_environment(), progress=advance
            )
        for row, comparison in zip(result["fits"], comparisons, strict=True):
            row["psnr_object_db"] = comparison.metrics.psnr_object_db
        plots.fits(brdf.name, [each.model for each in found], comparisons, options.picture)
    if options.output:
        fits.write(options.output, brdf.name, result["fits"])
    if not options.json:
        print_fits(f"{options.material}: {chosen.loss} error of fits", result["fits"], found)
    return result


def factor(options: Namespace) -> dict[str, Any]:
    chosen = FactorOptions(options.lobes, options.terms)
    check_output(options.output, (".fbrdf",), options.material)
    brdf = load(options.material)
    started = time.perf_counter()
    with console.progress(f"factoring {brdf.name}") as advance:
        material = factored(brdf, chosen, progress=advance)
    seconds = time.perf_counter() - started
    written = fbrdf.save(material, options.output)
    known = describe(material, written) | clamped(brdf)
    if not options.json:
        rows = {
            "lobes × terms": text(known["terms"]),
            "size in memory": console.size(material.bytes_memory),
            "size on disk": console.size(written),
            **fact_rows(known["facts"]),
            **origin_rows(material),
            **(fact_rows(clamped(brdf)) if known["cells_clamped"] else {}),
            "time": f"{seconds:.1f} s",
        }
        console.print_rows(f"{material.name} → {options.output}", rows)
    return known | {"seconds": seconds, "output": str(options.output)}


def plot(options: Namespace) -> dict[str, Any]:
    for source in options.materials:
        check_output(options.output, tuple(plots.FORMATS), source)
    if len(options.materials) > plots.MOST_MATERIALS:
        raise OptionError(f"materials: expected 1 to {plots.MOST_MATERIALS}, found {len(options.materials)}")
    materials = _by_name(options.materials)
    figure, kinds = plots.sheet(materials, options.kind)
    plots.save(figure, options.output)
    if not options.json:
        console.say(f"{', '.join(materials)} → {options.output} ({', '.join(kinds)})")
    return {"image": str(options.output), "kinds": kinds, "materials": list(materials)}


def _by_name(sources: list[str]) -> dict[str, Brdf]:
    """Materials by their names; by name and source where that is the same, as of a table and what was made of it."""
    again = next((source for source in sources if sources.count(source) > 1), None)
    if again:
        raise OptionError(f"materials: expected different ones, found {again} twice")
    found = [(source, load(source)) for source in sources]
    names = [brdf.name for _, brdf in found]
    result: dict[str, Brdf] = {}
    for source, brdf in found:
        alone = names.count(brdf.name) == 1 or brdf.name.startswith(source)  # a built-in one's says where it is from
        name = brdf.name if alone else f"{Path(source).name}: {brdf.name}"
        result[f"{source}: {brdf.name}" if name in result else name] = brdf
    return result


def alike(reference: Brdf, candidate: Brdf, asked: Any) -> tuple[Brdf, Brdf]:
    """Both, looked up as asked; else a table as the SOM-MAN material on its lattice, so that like meets like."""

    def adapted(brdf: Brdf, other: Brdf) -> Brdf:
        if asked:
            return interpolated(brdf, asked)
        if isinstance(brdf, BrdfTable) and isinstance(other, SomManBrdf) and other.grid == brdf.lattice:
            return brdf.with_interpolation(other.interpolation)
        return brdf

    return adapted(reference, candidate), adapted(candidate, reference)


def table_distance(reference: Brdf, candidate: Brdf) -> dict[str, float]:
    """How far two are apart at the cell centres of one lattice: the reference's, the candidate's or MERL's."""
    lattices = [brdf.grid for brdf in (reference, candidate) if isinstance(brdf, OnLattice) and brdf.grid]
    first, second = (BrdfTable.sample(brdf, *lattices[:1]) for brdf in (reference, candidate))
    return asdict(table_metrics(first.values, second.values, first.lattice))


def check_output(path: Path, extensions: tuple[str, ...], *sources: str | Path | None) -> None:
    """Says before long work what would go wrong after it. sources: what is read, and so not to be written."""
    if path.suffix.lower() not in extensions:
        raise OptionError(f"{path}: expected a name that ends in {' or '.join(extensions)}, found {path.suffix!r}")
    check_apart(path, *sources)
    check_writable(path)


def check_apart(path: Path, *sources: str | Path | None) -> None:
    """Raises OptionError if a file that is to be written is one of those that are read."""
    for source in sources:
        file = split_member(source)[0] if source else None
        if file and path.exists() and file.exists() and path.samefile(file):
            raise OptionError(f"{path}: expected an output other than the input")


def check_range(name: str, value: int, low: int, high: int) -> None:
    """Raises OptionError for a number out of range."""
    if not low <= value <= high:
        raise OptionError(f"{name}: expected {low} to {high}, found {value}")


def check_rendering(options: Namespace) -> None:
    """Checks the options that all renderings have."""
    for name, low, high in (("spp", 1, MOST_SPP), ("size", SMALLEST_SIZE, LARGEST_SIZE), ("seed", 0, 2**64 - 1)):
        check_range(name, getattr(options, name), low, high)
    if options.envmap and not options.envmap.is_file():
        raise FormatError(f"{options.envmap}: expected an environment image, found no file")


@contextmanager
def goes_on_from(checkpoint: Checkpoint) -> Generator[console.Advance | None]:
    """A progress bar for a render; if that is interrupted, it is said whether it can go on."""
    try:
        with console.progress("rendering") as advance:
            yield advance
    except KeyboardInterrupt:
        if checkpoint.holds:
            console.tell(f"{checkpoint.path}: from here, the same command goes on")
        raise


def environment_of(options: Namespace, warn: Callable[[str], None]) -> Any:
    """The environment asked for, or the built-in one."""
    return load_environment(options.envmap, warn) if options.envmap else default_environment()
