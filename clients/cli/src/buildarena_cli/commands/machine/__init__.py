"""`buildarena machine`: machines on this computer, without any server."""

from buildarena_cli.commands.machine.files import check, export
from buildarena_cli.commands.machine.trials import simulate
from buildarena_cli.options import new_group

app = new_group("Check and simulate machines on this computer.")
app.command("check")(check)
app.command("export")(export)
app.command("simulate")(simulate)
