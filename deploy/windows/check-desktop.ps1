<#
.SYNOPSIS
Says what of this Windows would stop a runner in the middle of its work.

.DESCRIPTION
The runner needs a desktop that is shown, unlocked and awake, and a game that takes its clicks: a
screen saver, a lock, sleep, or a game with more rights than the runner end that hours later, when
nobody looks. Nothing is changed. The exit code is 1 when something has to be.
#>
[CmdletBinding()]
param(
    [string] $GameFolder = 'C:\Program Files (x86)\Steam\steamapps\common\Besiege'
)

. "$PSScriptRoot\common.ps1"

function Get-RegistryValue {
    param([Parameter(Mandatory)] [string] $Path, [Parameter(Mandatory)] [string] $Name)
    $key = Get-ItemProperty -LiteralPath $Path -ErrorAction SilentlyContinue
    if ($null -eq $key) { return $null }
    $property = $key.PSObject.Properties[$Name]
    if ($null -eq $property) { return $null }
    $property.Value
}

function Get-PowerSeconds {
    # The setting on mains: the last but one of the numbers that powercfg writes, in any language.
    param([Parameter(Mandatory)] [string] $Group, [Parameter(Mandatory)] [string] $Setting)
    $text = (& powercfg.exe /query SCHEME_CURRENT $Group $Setting 2>$null) -join ' '
    $numbers = [regex]::Matches($text, '0x([0-9a-fA-F]{8})')
    if ($numbers.Count -lt 2) { return 0 }
    [Convert]::ToInt64($numbers[$numbers.Count - 2].Groups[1].Value, 16)
}

function Get-SleepFinding {
    $settings = @(
        @('SUB_SLEEP', 'STANDBYIDLE', 'the machine sleeps', 'powercfg /change standby-timeout-ac 0'),
        @('SUB_SLEEP', 'HIBERNATEIDLE', 'the machine hibernates', 'powercfg /change hibernate-timeout-ac 0'),
        @('SUB_VIDEO', 'VIDEOIDLE', 'the screen goes dark', 'powercfg /change monitor-timeout-ac 0')
    )
    foreach ($setting in $settings) {
        $seconds = Get-PowerSeconds -Group $setting[0] -Setting $setting[1]
        if ($seconds -gt 0) { "$($setting[2]) after $seconds s without input: $($setting[3])" }
    }
}

function Get-LockFinding {
    $places = @(
        'HKCU:\Software\Policies\Microsoft\Windows\Control Panel\Desktop',
        'HKCU:\Control Panel\Desktop'
    )
    foreach ($place in $places) {
        $active = Get-RegistryValue -Path $place -Name 'ScreenSaveActive'
        $program = Get-RegistryValue -Path $place -Name 'SCRNSAVE.EXE'
        if ($active -eq '1' -and $program) {
            'a screen saver is on: set it to none in Settings, Lock screen'
            break
        }
    }
    $policy = 'HKLM:\SOFTWARE\Microsoft\Windows\CurrentVersion\Policies\System'
    $seconds = Get-RegistryValue -Path $policy -Name 'InactivityTimeoutSecs'
    if ($seconds -gt 0) {
        "a policy locks the screen after $seconds s (InactivityTimeoutSecs): have it lifted for this machine"
    }
    if ("$env:SESSIONNAME" -like 'RDP-*') {
        'this is a remote session, whose screen locks when it is left: log on at the machine itself'
    }
}

function Get-ElevationFinding {
    # A program without an administrator's rights cannot click in one that has them.
    $layers = @(
        'HKCU:\Software\Microsoft\Windows NT\CurrentVersion\AppCompatFlags\Layers',
        'HKLM:\SOFTWARE\Microsoft\Windows NT\CurrentVersion\AppCompatFlags\Layers'
    )
    foreach ($layer in $layers) {
        $key = Get-ItemProperty -LiteralPath $layer -ErrorAction SilentlyContinue
        if ($null -eq $key) { continue }
        foreach ($entry in $key.PSObject.Properties) {
            if ("$($entry.Value)" -match 'RUNASADMIN' -and $entry.Name -match '\\(Besiege|steam)\.exe$') {
                "$($entry.Name) is set to run as administrator: take that off in its properties, Compatibility"
            }
        }
    }
    $running = Get-CimInstance -ClassName Win32_Process -Filter "Name = 'Besiege.exe'"
    foreach ($game in $running) {
        if (-not $game.ExecutablePath) {
            'the game runs with the rights of an administrator: start it, and Steam, without them'
        }
    }
}

function Get-AutologonAdvice {
    $winlogon = 'HKLM:\SOFTWARE\Microsoft\Windows NT\CurrentVersion\Winlogon'
    if ((Get-RegistryValue -Path $winlogon -Name 'AutoAdminLogon') -ne '1') {
        'nobody is logged on automatically: after a restart of the machine the runner waits for it (netplwiz)'
    }
}

Assert-Windows
if (-not (Test-Path -LiteralPath $GameFolder)) {
    Write-Warning "$GameFolder is not there: name the game's folder with -GameFolder"
}
foreach ($advice in @(Get-AutologonAdvice)) { Write-Warning $advice }
$findings = @(Get-SleepFinding) + @(Get-LockFinding) + @(Get-ElevationFinding)
foreach ($finding in $findings) { Write-Output "!!  desktop: $finding" }
if ($findings.Count -gt 0) { exit 1 }
Write-Output 'ok  desktop: shown, unlocked and awake for as long as the machine runs'
