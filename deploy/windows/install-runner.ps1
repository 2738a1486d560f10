<#
.SYNOPSIS
Makes this machine play Besiege for a BuildArena service.

.DESCRIPTION
Installs Python packages into a folder of this account, keeps the runner's key in a file that only
this account reads, checks and calibrates the game, and starts the runner whenever this account logs
on: the game needs a desktop, so a service of the system would not do. Nothing but HTTPS to the API
goes out, and nothing comes in. Run it again to change anything; it needs no administrator.

.EXAMPLE
.\install-runner.ps1 -Api https://arena.example.org -Wheels .\dist -GameVersion 1.75-23370 -ModVersion 1.4
#>
[CmdletBinding()]
param(
    # Address of the service, with its path where it has one.
    [Parameter(Mandatory)] [ValidatePattern('^https?://')] [string] $Api,
    # Versions of the game and of its Lua Scripting Mod, as the service names them.
    [Parameter(Mandatory)] [ValidatePattern('^[A-Za-z0-9._-]{1,40}$')] [string] $GameVersion,
    [Parameter(Mandatory)] [ValidatePattern('^[A-Za-z0-9._-]{1,40}$')] [string] $ModVersion,
    # Folder of the wheels that `make release` wrote; without it they come from the package index.
    [string] $Wheels,
    # File with the runner's key; without it the key is asked for.
    [string] $Key,
    [string] $GameFolder = 'C:\Program Files (x86)\Steam\steamapps\common\Besiege',
    # Command that starts the game, so that the runner can restart a frozen one.
    [string] $GameCommand = '',
    # Task whose level is open in the game, for example support-1.
    [string] $Level = '',
    # Certificates to trust besides the system's (PEM), for a service with its own authority.
    [string] $CaFile = '',
    [string] $Python = 'py',
    [switch] $SkipCalibration,
    # Installs although the screen may lock, sleep or show a screen saver.
    [switch] $SkipDesktopCheck
)

. "$PSScriptRoot\common.ps1"

function Save-Constraints {
    # Each wheel of ours by its path, so that no index can put another of its name in its place;
    # everything else in the versions that were tested.
    param([Parameter(Mandatory)] [string] $Folder)
    $ours = @(Get-ChildItem -LiteralPath $Folder -Filter 'buildarena*.whl')
    if ($ours.Count -eq 0) { throw "$Folder has no wheels of BuildArena: name the folder that make release wrote" }
    $lines = @($ours | ForEach-Object {
        $name = $_.Name.Split('-')[0].Replace('_', '-')
        "$name @ $(([Uri] $_.FullName).AbsoluteUri)"
    })
    $tested = Join-Path $Folder 'constraints.txt'
    if (-not (Test-Path -LiteralPath $tested)) { throw "$tested is not there: copy the whole folder that make release wrote" }
    $lines += @(Get-Content -LiteralPath $tested)
    [IO.File]::WriteAllLines($Constraints, [string[]] $lines)
}

function Get-Wheel {
    param([Parameter(Mandatory)] [string] $Folder, [Parameter(Mandatory)] [string] $Name)
    $found = @(Get-ChildItem -LiteralPath $Folder -Filter "$Name-*.whl")
    if ($found.Count -ne 1) { throw "$Folder has $($found.Count) wheels of ${Name}: copy what make release wrote into an empty folder" }
    $found[0].FullName
}

function Install-Packages {
    $launcher = if ($Python -eq 'py') { @('py', '-3') } else { @($Python) }
    $words = @($launcher | Select-Object -Skip 1)
    $version = & $launcher[0] @words -c "import struct, sys; print(sys.version_info >= (3, 11) and struct.calcsize('P') == 8)"
    if ($LASTEXITCODE -ne 0 -or $version -ne 'True') {
        throw "$Python is not a 64-bit Python 3.11 or newer: install one from python.org, or name it with -Python"
    }
    if (-not (Test-Path -LiteralPath (Join-Path $Venv 'Scripts\python.exe'))) {
        & $launcher[0] @words -m venv $Venv
        if ($LASTEXITCODE -ne 0) { throw "no environment could be made in $Venv" }
    }
    $from = @()
    $wanted = @('buildarena[besiege]')
    if ($Wheels) {
        $folder = (Resolve-Path -LiteralPath $Wheels).Path
        Save-Constraints -Folder $folder
        $from = @('--constraint', $Constraints)
        # What is asked for by its name and an extra is not taken from a constraint's path.
        $wanted = @("$(Get-Wheel -Folder $folder -Name 'buildarena')[besiege]")
    }
    & (Join-Path $Venv 'Scripts\python.exe') -m pip install --quiet --disable-pip-version-check --upgrade @from @wanted
    if ($LASTEXITCODE -ne 0) { throw 'the packages could not be installed; pip says why above' }
}

function Save-Key {
    if ($Key) {
        $secret = (Get-Content -LiteralPath $Key -Raw).Trim()
    }
    elseif (Test-Path -LiteralPath $KeyFile) {
        return
    }
    else {
        $hidden = Read-Host -Prompt 'Key of the runner (it is not shown)' -AsSecureString
        $secret = [Net.NetworkCredential]::new('', $hidden).Password.Trim()
    }
    if (-not $secret) { throw 'the key is empty' }
    # Closed before anything stands in it.
    [IO.File]::WriteAllText($KeyFile, '')
    Protect-OwnFile -Path $KeyFile
    [IO.File]::WriteAllText($KeyFile, $secret)
}

function Save-Settings {
    $environment = [ordered]@{
        BUILDARENA_BESIEGE_GAME   = $GameVersion
        BUILDARENA_BESIEGE_MOD    = $ModVersion
        BUILDARENA_BESIEGE_FOLDER = $GameFolder
        BUILDARENA_BESIEGE_STATE  = (Join-Path $Root 'besiege')
    }
    if ($GameCommand) { $environment['BUILDARENA_BESIEGE_COMMAND'] = $GameCommand }
    if ($Level) { $environment['BUILDARENA_BESIEGE_LEVEL'] = $Level }
    $kept = [ordered]@{ api = $Api.TrimEnd('/'); ca_file = $CaFile; environment = $environment }
    # Without the mark of byte order that Set-Content writes.
    [IO.File]::WriteAllText($SettingsFile, ($kept | ConvertTo-Json -Depth 4))
}

function Test-Desktop {
    & (Join-Path $PSScriptRoot 'check-desktop.ps1') -GameFolder $GameFolder
    if ($LASTEXITCODE -ne 0 -and -not $SkipDesktopCheck) {
        throw 'this desktop would stop the runner: change what is named above, or give -SkipDesktopCheck'
    }
}

function Test-Runner {
    $trust = @()
    if ($CaFile) { $trust = @('--ca-file', $CaFile) }
    Invoke-BuildArena admin worker simulate.besiege --check --api $Api --key-file $KeyFile @trust
    if (-not $SkipCalibration) {
        Invoke-BuildArena besiege calibrate
    }
    Invoke-BuildArena besiege doctor
}

function Register-Runner {
    $powershell = Join-Path $env:SystemRoot 'System32\WindowsPowerShell\v1.0\powershell.exe'
    $script = Join-Path $Root 'start-runner.ps1'
    $action = New-ScheduledTaskAction -Execute $powershell -WorkingDirectory $Root `
        -Argument "-NoProfile -ExecutionPolicy Bypass -WindowStyle Hidden -File `"$script`""
    $account = [Security.Principal.WindowsIdentity]::GetCurrent().Name
    $trigger = New-ScheduledTaskTrigger -AtLogOn -User $account
    $principal = New-ScheduledTaskPrincipal -UserId $account -LogonType Interactive -RunLevel Limited
    $settings = New-ScheduledTaskSettingsSet -ExecutionTimeLimit ([TimeSpan]::Zero) `
        -MultipleInstances IgnoreNew -StartWhenAvailable -AllowStartIfOnBatteries `
        -DontStopIfGoingOnBatteries -RestartCount 999 -RestartInterval (New-TimeSpan -Minutes 1)
    try {
        Register-ScheduledTask -TaskName $TaskName -Action $action -Trigger $trigger `
            -Principal $principal -Settings $settings -Force | Out-Null
    }
    catch {
        throw "the task could not be registered ($($_.Exception.Message)): some machines let only administrators do it; start this script once more as one, with the same account"
    }
}

Assert-Windows
Test-Desktop
New-Item -ItemType Directory -Force -Path $Root, $Logs | Out-Null
Stop-Runner
Install-Packages
Save-Key
Save-Settings
foreach ($name in 'common.ps1', 'check-desktop.ps1', 'start-runner.ps1', 'uninstall-runner.ps1') {
    $source = Join-Path $PSScriptRoot $name
    $target = Join-Path $Root $name
    if ($source -ne $target) { Copy-Item -LiteralPath $source -Destination $target -Force }
}
Set-RunnerEnvironment -Settings (Read-RunnerSettings)
Test-Runner
Register-Runner
Start-ScheduledTask -TaskName $TaskName
Write-Output "The runner plays for $Api now and after each logon; its log is in $Logs."
Write-Output 'Hands off mouse and keyboard: the mouse in the upper left corner stops it.'
