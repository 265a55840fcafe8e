"""``toposeam gimp`` in a home folder of its own."""

from click.testing import CliRunner

from toposeam_cli.app.main import main


def run(*arguments, code=0):
    result = CliRunner().invoke(main, ["gimp", *map(str, arguments)])
    assert result.exit_code == code, result.output
    return result.output


def plug_in(home, version):
    return home / ".config" / "GIMP" / version / "plug-ins" / "toposeam_gimp"
