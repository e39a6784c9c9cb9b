#include "tools/reasons/reasons.h"

#include <array>

namespace beltgrip::reasons {

namespace {

using daemon::Fault;
using daemon::Inhibit;

struct InhibitRow {
  Inhibit value;
  Words words;
};
constexpr std::array<InhibitRow, daemon::kInhibitCount> kInhibitWords{{
    {Inhibit::kInputs,
     {"a signal of a role is not there, too old, or out of range",
      "`beltgrip status can0` shows each role with its age; is the right interface, DBC and "
      "message named?"}},
    {Inhibit::kFault, {"a fault that forbids requests (below)", "mend the fault"}},
    {Inhibit::kPermission,
     {"`experiment_permitted` is 0", "the controller withholds it; ask it why"}},
    {Inhibit::kPedal,
     {"`coast_down` and the accelerator is pressed",
      "lift the foot; for drive torque `trigger = \"steady\"`"}},
    {Inhibit::kBrake, {"the brake is pressed", "coast without braking"}},
    {Inhibit::kLockup,
     {"the lock-up clutch is open: the engine's torque is not the belt's",
      "warm up, drive faster; is the flag read the right way round (`true_when`)?"}},
    {Inhibit::kRatio,
     {"the speed ratio is not at an end stop",
      "`ratio_low` and `ratio_overdrive`: `beltgrip calibrate` finds them; are the two speeds "
      "swapped?"}},
    {Inhibit::kTorque,
     {"the torque on the belt lies outside its window",
      "coast at another speed; check sign and unit of the torque"}},
    {Inhibit::kSpeed,
     {"the primary shaft turns more slowly than `primary_speed_min_rad_s`",
      "begin at a higher speed"}},
    {Inhibit::kOil, {"the oil is colder than `oil_temperature_min_degC`", "warm up"}},
    {Inhibit::kCooldown,
     {"too little time or distance since the last request", "wait: `cooldown_s`, `cooldown_m`"}},
    {Inhibit::kUnreachable,
     {"the floor of the clamping force lies above the force of the peak",
      "more torque, a lower pressure floor, a lower speed in overdrive; else a lower bound is all "
      "there is"}},
    {Inhibit::kRamp,
     {"the belt cannot cross its peak and be caught inside the slip limits, at the steepest fall "
      "behind it that must be survived (`fall_max_per_percent`) or if something fails at the worst "
      "instant",
      "a faster actuator, less torque, more reserve in the own force; a smaller "
      "`fall_max_per_percent` if the belt is known"}},
    {Inhibit::kTime,
     {"the ramp would last longer than the coast-down or 15 s",
      "a higher `ramp_rate_max_N_per_s`, a flatter road"}},
    {Inhibit::kGrip,
     {"the belt slips under the controller's own force by much of the way to its peak: friction "
      "has fallen",
      "have the belt looked at; the controller's force is too low for it"}},
    {Inhibit::kForce,
     {"the controller's own clamping force is still moving", "wait until it is steady"}},
    {Inhibit::kQuiet,
     {"neither the primary's nor the engine's speed moves often enough that one standing still "
      "would show within 0.6 s",
      "add the role `engine_speed`; take the raw signal with its finest step; a coast-down instead "
      "of steady driving"}},
    {Inhibit::kWait,
     {"at a lower speed there is more room to cross the peak; it begins by itself, 9 s after the "
      "trigger at the latest",
      "nothing"}},
    {Inhibit::kModel,
     {"a quantity lies outside the box in which a term of the model file was learned "
      "(`[learned.NAME]`)",
      "drive inside the box; let `beltgrip diagnose` learn from drives that reach further; or "
      "leave "
      "`[estimator] model` out"}},
}};

struct FaultRow {
  Fault value;
  Words words;
};
constexpr std::array<FaultRow, daemon::kFaultCount> kFaultWords{{
    {Fault::kInputMissing,
     {"a required signal has never come",
      "interface, DBC, message; `beltgrip status` names the role"}},
    {Fault::kInputStale,
     {"it came and has stopped",
      "`beltgrip status` names the role; `period_ms` of a role that comes seldom"}},
    {Fault::kInputFrozen,
     {"a value stands still where a live one moves, or takes a course that cannot be",
      "sensor, gateway"}},
    {Fault::kInputRange,
     {"out of the DBC's range, \"not available\", or a spike", "the DBC's range; the sensor"}},
    {Fault::kInputNotFinite, {"a float signal is no number", "the sender"}},
    {Fault::kInputFrame, {"a frame of wrong length or kind", "another version of the DBC?"}},
    {Fault::kTimeStamp, {"a time stamp went backwards", "the adapter's driver"}},
    {Fault::kFramesLost,
     {"the kernel dropped frames", "the machine is too busy; run as the service does"}},
    {Fault::kSampleLate,
     {"a sample was taken late", "the machine is too busy; run as the service does"}},
    {Fault::kBusPassive,
     {"the CAN controller is error passive", "wiring, bit rate, `beltgrip can status can0`"}},
    {Fault::kBusOff,
     {"the CAN controller is bus-off", "wiring, bit rate, `beltgrip can status can0`"}},
    {Fault::kBusDown,
     {"the CAN interface is down or gone", "wiring, bit rate, `beltgrip can status can0`"}},
    {Fault::kForeignSender,
     {"another node sends with BeltGrip's identifiers",
      "a second daemon, or a log that is being played"}},
    {Fault::kSendFailed, {"a frame could not be sent", "a full bus"}},
    {Fault::kFrameRefused,
     {"the transmit gate stopped a frame of our own", "a defect of BeltGrip: please report it"}},
    {Fault::kResultDoubtful,
     {"the last result contradicts the ones before, or itself; or the belt slipped with less "
      "friction than was known, here or in the other direction or end stop",
      "repeat; the lower value counts until this one is measured, after a restart too"}},
    {Fault::kHistoryUnwritten,
     {"the history of experiments cannot be read or written", "disk, rights of the state folder"}},
    {Fault::kInputRate,
     {"a message comes too often or too seldom", "a second sender? the cycle time in the DBC?"}},
    {Fault::kInputProtection,
     {"wrong counter or CRC", "`[protection]`: data id, profile, signals"}},
    {Fault::kClampStuck,
     {"after a request the clamping force did not come back",
      "the controller does not keep its contract; a restart is needed"}},
}};

// Each row at its value's place.
constexpr bool in_order(const auto& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (static_cast<std::size_t>(rows[i].value) != i) return false;
  }
  return true;
}
static_assert(in_order(kInhibitWords) && in_order(kFaultWords));

}  // namespace

const Words& words_of(Inhibit inhibit) {
  return kInhibitWords.at(static_cast<std::size_t>(inhibit)).words;
}
const Words& words_of(Fault fault) { return kFaultWords.at(static_cast<std::size_t>(fault)).words; }

}  // namespace beltgrip::reasons
