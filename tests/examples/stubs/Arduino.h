/* Stand-in for the header of Arduino, with what the example uses. */
#pragma once

#include <stdint.h>

enum { LED_BUILTIN = 13, OUTPUT = 1, LOW = 0, HIGH = 1 };

static uint32_t stub_micros = 0;
static int stub_led = -1;
static inline void pinMode(int, int) {}
static unsigned stub_noise = 1; // a living skin never repeats its readings
static inline int analogRead(int pin)
{
    stub_noise = stub_noise * 1103515245u + 12345u + (unsigned)pin;
    return 500 + (int)(stub_noise >> 16) % 3;
}
static inline void digitalWrite(int, int value) { stub_led = value; }
static inline uint32_t micros(void) { return stub_micros; }
static inline void delay(uint32_t milliseconds) { stub_micros += 1000 * milliseconds; }
