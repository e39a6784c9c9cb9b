// A frame of a log with what a DBC says of it, and its three forms. Tools only.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/model.h"
#include "can_dbc/log/can_log.h"

namespace beltgrip::cli {

// A message of a DBC that is to be decoded: which of its signals are wanted.
// First what most frames need.
struct alignas(64) ChosenMessage {
  const can::MessageDef* definition = nullptr;
  std::size_t number = 0;             // among all messages of all DBC files
  bool names_repeat = false;          // among its signals
  std::vector<std::size_t> unwanted;  // signals
  can::MessageCodec codec;
  std::vector<bool> wanted;            // beside the definition's signals
  std::vector<unsigned> decimals;      // of each signal's values, as text::decimals_of() has it
  std::vector<std::uint32_t> columns;  // in CSV: of each wanted signal

  static constexpr std::size_t kNear = 192;  // bytes that a frame without a selector needs
};

struct DecodedFrame {
  const can::LogRecord& record;
  const ChosenMessage& message;
  const can::DecodedMessage& values;  // what is present and wanted
};

// Text of the value table; nullptr: none.
const can::Text* label_of(const DecodedFrame& frame, std::size_t signal);

class FrameWriter {
 public:
  virtual ~FrameWriter() = default;
  virtual std::string head() const { return {}; }
  virtual void append(const DecodedFrame& frame, std::string& out) = 0;
  // A frame of this message will come: what of it can be brought near; and some frames later what
  // that leads to.
  virtual void expect(const ChosenMessage& message) const { static_cast<void>(message); }
  virtual void expect_soon(const ChosenMessage& message) const { static_cast<void>(message); }
};

// Each gets the messages in the order of their columns.
std::unique_ptr<FrameWriter> text_writer(bool with_raw);
std::unique_ptr<FrameWriter> json_writer(bool with_raw);
// One column a signal, a row a frame. Failure 64 with more columns than a table can be read with.
std::unique_ptr<FrameWriter> csv_writer(std::span<const ChosenMessage* const> messages,
                                        bool with_raw);

}  // namespace beltgrip::cli
