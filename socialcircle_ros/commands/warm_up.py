# SPDX-License-Identifier: Apache-2.0
"""`socialcircle warm-up`."""

import time

import click

from .options import progress_bar


@click.command('warm-up', epilog='Example, in a Dockerfile: RUN socialcircle warm-up')
def command() -> None:
    """Compile the kernels into the cache, so that no later process compiles.

    Run it once when the package is installed or an image is built, as the user that will run the node or as one
    whose files that user can read. It takes about 105 s of processor time the first time, on up to two cores, and
    a second when nothing is new.

    The cache lies beside the package, or in NUMBA_CACHE_DIR. It may be read-only afterwards. Another processor, or
    another version of Numba, compiles anew: build images on the kind of processor that they run on. What cannot be
    written is an error: the kernels would be compiled again in each process.
    """
    from socialcircle_ros.errors import SettingError, SocialCircleError
    from socialcircle_ros.kernels.caches import write_failure
    from socialcircle_ros.kernels.compiled import cache_folder
    from socialcircle_ros.node import warm_up
    from socialcircle_ros.settings import require_runtime

    nowhere = SocialCircleError(
        'No folder for the cache can be written: set NUMBA_CACHE_DIR to one that can, here and for the node.'
    )
    if cache_folder() is None and not warm_up.is_warm():
        raise nowhere
    began_s = time.monotonic()
    steps = list(warm_up.steps())
    with progress_bar('compiling') as progress:
        for done, compile_some in enumerate(steps):
            progress(done, len(steps))
            compile_some()
    failure = write_failure()
    if failure is not None and cache_folder() is None:
        raise nowhere
    if failure is not None:
        raise SocialCircleError(
            f'The kernels cannot be kept in {cache_folder()} ({failure}), so each process would compile them: make'
            ' room there, or set NUMBA_CACHE_DIR to another folder, here and for the node.'
        )
    click.echo(
        f'The kernels are compiled ({time.monotonic() - began_s:.1f} s); they lie under {warm_up.folder()}.'
    )
    try:
        require_runtime()
    except SettingError as error:
        click.echo(error, err=True)
