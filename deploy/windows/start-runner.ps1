<#
.SYNOPSIS
Serves the queue of the game until it is stopped; the scheduled task starts it at logon.
#>
[CmdletBinding()]
param(
    [int] $MaxLogBytes = 10485760,
    [int] $KeptLogs = 5
)

. "$PSScriptRoot\common.ps1"

$Log = Join-Path $Logs 'runner.log'

function Move-OldLog {
    # runner.log becomes runner.1.log, and so on; the oldest goes.
    for ($number = $KeptLogs - 1; $number -ge 0; $number--) {
        $from = if ($number -eq 0) { $Log } else { Join-Path $Logs "runner.$number.log" }
        $to = Join-Path $Logs "runner.$($number + 1).log"
        if (Test-Path -LiteralPath $from) { Move-Item -LiteralPath $from -Destination $to -Force }
    }
}

function Write-RunnerLog {
    param([Parameter(ValueFromPipeline)] $Line)
    process {
        $text = "$Line" + [Environment]::NewLine
        [IO.File]::AppendAllText($Log, $text)
        if ((Get-Item -LiteralPath $Log).Length -gt $MaxLogBytes) { Move-OldLog }
    }
}

Assert-Windows
New-Item -ItemType Directory -Force -Path $Logs | Out-Null
$settings = Read-RunnerSettings
Set-RunnerEnvironment -Settings $settings
$trust = @()
if ($settings.ca_file) { $trust = @('--ca-file', $settings.ca_file) }

# What the program writes to standard error is its log, no error of this script.
$ErrorActionPreference = 'Continue'
$pause = 5
while ($true) {
    $began = Get-Date
    & $BuildArena admin worker simulate.besiege --api $settings.api --key-file $KeyFile @trust 2>&1 | Write-RunnerLog
    "$(Get-Date -Format o) the runner ended with $LASTEXITCODE" | Write-RunnerLog
    # A service that is away is asked less and less often, up to every five minutes.
    $pause = if (((Get-Date) - $began).TotalMinutes -gt 10) { 5 } else { [Math]::Min(2 * $pause, 300) }
    Start-Sleep -Seconds $pause
}
