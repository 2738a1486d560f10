<#
.SYNOPSIS
Stops the runner and removes what install-runner.ps1 made; the game stays as it is.

.DESCRIPTION
A job at hand goes back to the service when its lease ends, within seconds. Revoke the runner's key
at the service too: buildarena admin key revoke KEY
#>
[CmdletBinding()]
param([switch] $KeepLogs)

. "$PSScriptRoot\common.ps1"

Assert-Windows
Stop-Runner
if (Get-ScheduledTask -TaskName $TaskName -ErrorAction SilentlyContinue) {
    Unregister-ScheduledTask -TaskName $TaskName -Confirm:$false
}
if (Test-Path -LiteralPath $KeyFile) { Remove-Item -LiteralPath $KeyFile -Force }
$left = @($Venv, $SettingsFile, $Constraints, (Join-Path $Root 'besiege'))
if (-not $KeepLogs) { $left += $Logs }
foreach ($path in $left) {
    if (Test-Path -LiteralPath $path) { Remove-Item -LiteralPath $path -Recurse -Force }
}
# Last, as this script may be one of them.
foreach ($name in 'start-runner.ps1', 'check-desktop.ps1', 'common.ps1', 'uninstall-runner.ps1') {
    $path = Join-Path $Root $name
    if (Test-Path -LiteralPath $path) { Remove-Item -LiteralPath $path -Force }
}
Write-Output 'The runner is gone. Revoke its key at the service: buildarena admin key revoke KEY'
