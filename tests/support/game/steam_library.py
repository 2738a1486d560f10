"""Files as Steam and the mod leave them on a machine with the game."""

from pathlib import Path

from buildarena_simworker.besiege.installed import LUA_MOD_ID

MOD_XML = "<Mod>\n\t<Name>{name}</Name>\n\t<Version>{version}</Version>\n<ID>{id}</ID>\n</Mod>"


def library(tmp_path: Path, *, build: str = "25346", version: str = "1.4") -> Path:
    """A folder of Steam with the game and its mod, two levels below the workshop's folder."""
    steam = tmp_path / "steamapps"
    game = steam / "common" / "Besiege"
    mod = steam / "workshop" / "content" / "346010" / "2383785201" / "LuaScripting"
    for folder in (game / "Besiege_Data" / "SavedMachines", mod):
        folder.mkdir(parents=True, exist_ok=True)
    text = MOD_XML.format(name="Scripting", version=version, id=LUA_MOD_ID.upper())
    (mod / "Mod.xml").write_text(text, encoding="utf-8")
    other = mod.parents[1] / "1" / "Other"
    other.mkdir(parents=True, exist_ok=True)
    (other / "Mod.xml").write_text(MOD_XML.format(name="Lua toys", version="9", id="1"))
    (steam / "appmanifest_346010.acf").write_text(
        f'"AppState"\n{{\n\t"appid"\t\t"346010"\n\t"buildid"\t\t"{build}"\n}}\n'
    )
    return game
