// One fingertip on a microcontroller: the LED is on while the finger slides or is unstable.
//
//     holdfast export builtin:noise-floor model.h --sensor anyskin --fingers 1 --float
//
// Put model.h beside this file. Replace read_taxels by that of your sensor. A model with the
// taxels of builtin:any needs more memory than most boards have: see the sizes that export prints.
#include <Arduino.h>

#include "model.h"

static holdfast_detector detector;
static holdfast_estimate estimate;
static holdfast_real readings[HOLDFAST_N_TAXELS][3];
static double seconds = 0.0;
static uint32_t last_micros = 0;

static void read_taxels(holdfast_real (*values)[3])
{
  for (int i = 0; i < HOLDFAST_N_TAXELS; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      values[i][axis] = analogRead(3 * i + axis);
    }
  }
}

void setup()
{
  pinMode(LED_BUILTIN, OUTPUT);
  holdfast_init(&detector);
  last_micros = micros();
}

void loop()
{
  const uint32_t now = micros();
  seconds += 1e-6 * (uint32_t)(now - last_micros);  // micros() begins anew after 71 minutes
  last_micros = now;
  read_taxels(readings);
  if (holdfast_update(&detector, seconds, readings, &estimate) == HOLDFAST_OK) {
    const holdfast_finger_estimate *finger = &estimate.finger[0];
    const bool slides = finger->cause == HOLDFAST_CAUSE_SLIP;
    digitalWrite(LED_BUILTIN, slides || finger->state == HOLDFAST_UNSTABLE ? HIGH : LOW);
  }
  delay(10);
}
