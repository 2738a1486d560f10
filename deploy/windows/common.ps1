# What the other scripts share. Load it with: . "$PSScriptRoot\common.ps1"

Set-StrictMode -Version 3.0
$ErrorActionPreference = 'Stop'

$TaskName = 'BuildArena runner'
$Queue = 'simulate.besiege'

# Everything of the runner lies in one folder of the account that plays.
$Root = Join-Path $env:LOCALAPPDATA 'BuildArena'
$Venv = Join-Path $Root 'venv'
$BuildArena = Join-Path $Venv 'Scripts\buildarena.exe'
$KeyFile = Join-Path $Root 'runner.key'
$SettingsFile = Join-Path $Root 'runner.json'
$Constraints = Join-Path $Root 'constraints.txt'
$Logs = Join-Path $Root 'logs'

function Assert-Windows {
    if ($env:OS -ne 'Windows_NT') {
        throw 'The game runs on Windows: start this script there.'
    }
}

function Invoke-BuildArena {
    # Runs the command and fails with it; its output is the caller's.
    & $BuildArena @args
    if ($LASTEXITCODE -ne 0) {
        throw "buildarena $($args[0..1] -join ' ') ended with $LASTEXITCODE"
    }
}

function Read-RunnerSettings {
    if (-not (Test-Path -LiteralPath $SettingsFile)) {
        throw "$SettingsFile is not there: run install-runner.ps1 first"
    }
    Get-Content -LiteralPath $SettingsFile -Raw | ConvertFrom-Json
}

function Set-RunnerEnvironment {
    param([Parameter(Mandatory)] $Settings)
    foreach ($entry in $Settings.environment.PSObject.Properties) {
        [Environment]::SetEnvironmentVariable($entry.Name, [string]$entry.Value, 'Process')
    }
}

function Protect-OwnFile {
    # Leaves a file to this account alone: no inherited rights, nobody else's.
    param([Parameter(Mandatory)] [string] $Path)
    $me = [Security.Principal.WindowsIdentity]::GetCurrent().User
    $rights = New-Object Security.AccessControl.FileSecurity
    $rights.SetAccessRuleProtection($true, $false)
    $rule = New-Object Security.AccessControl.FileSystemAccessRule($me, 'FullControl', 'Allow')
    $rights.AddAccessRule($rule)
    Set-Acl -LiteralPath $Path -AclObject $rights
}

function Stop-Runner {
    # Stopping the task ends its script alone, and leaves the programs that this one started.
    if (Get-ScheduledTask -TaskName $TaskName -ErrorAction SilentlyContinue) {
        Stop-ScheduledTask -TaskName $TaskName
    }
    Get-CimInstance -ClassName Win32_Process |
        Where-Object { $_.ExecutablePath -and $_.ExecutablePath.StartsWith("$Venv\") } |
        ForEach-Object { Stop-Process -Id $_.ProcessId -Force -ErrorAction SilentlyContinue }
}
